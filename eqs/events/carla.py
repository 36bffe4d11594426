"""The event arrays of CARLA's DVS camera, saved as arrays or as their raw bytes, tick by tick.

Source: `LibCarla/source/carla/sensor/data/DVSEvent.h`, whose records are packed, and `DVSCamera`,
whose times are nanoseconds.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.events.bag import METADATA
from eqs.events.decoded import Decoded
from eqs.events.hints import Hints
from eqs.events.tables import DAMAGED_ARRAY, decoded

NAMES, KINDS = ["x", "y", "t", "pol"], ["<u2", "<u2", "<i8", "?"]
PACKED = np.dtype({"names": NAMES, "formats": KINDS})
# What a compiler makes of the same fields where nobody tells it to pack them.
PADDED = np.dtype(
    {"names": NAMES, "formats": KINDS, "offsets": [0, 2, 8, 16], "itemsize": 24}
)  # fmt: skip
RAW_SUFFIXES = (".bin", ".raw")
TICK_SUFFIXES = (".npy", ".npz", *RAW_SUFFIXES)
LOOKED_AT = 1 << 16  # records by which raw bytes are told from those of others
LONGEST_NS = 1 << 56  # two years, which a simulator's clock does not reach


def is_carla_array(path: Path) -> bool:
    """Whether an npy file holds CARLA's records: these names and types, packed or padded."""
    try:
        found = np.load(path, "r", allow_pickle=False).dtype
    except (*DAMAGED_ARRAY, EOFError):  # as whoever reads it will say
        return False
    if found.names is None or [*found.names] != NAMES or found.fields is None:
        return False
    return [found.fields[name][0] for name in NAMES] == [np.dtype(kind) for kind in KINDS]


def raw_records(path: Path) -> NDArray[Any] | None:
    """The records of a file of raw bytes, none of which are read yet; None where it holds others.

    Bytes say of themselves neither what they are nor whether they are packed: all that can be
    looked at must be polarities of 0 and 1, and times between zero and two years.
    """
    size = path.stat().st_size
    for kind in (PACKED, PADDED):
        if size and size % kind.itemsize == 0:
            count = size // kind.itemsize
            table: NDArray[Any] = np.memmap(path, kind, "r", shape=(count,))
            if _plausible(table[:LOOKED_AT]) and _plausible(table[-LOOKED_AT:]):
                return table
    return None


def _plausible(table: NDArray[Any]) -> bool:
    flags, t = table["pol"].view(np.uint8), table["t"]
    return bool((flags <= 1).all() and (t >= 0).all() and (t < LONGEST_NS).all())


def read_carla(table: NDArray[Any], path: Path, hints: Hints) -> Decoded:
    """Events of records of CARLA, by time, row and column.

    Raises:
        ValueError: a number is none that a time or a pixel can be.
    """
    columns = {"t": table["t"], "x": table["x"], "y": table["y"], "p": table["pol"]}
    part = decoded(columns, path, "events of CARLA", hints.time_unit or "ns")
    order = np.lexsort((part.x, part.y, part.t))
    return replace(part, **{name: getattr(part, name)[order] for name in "txyp"})


def read_carla_array(path: Path, hints: Hints) -> Decoded:
    """Events of an npy file of CARLA's records.

    Raises:
        ValueError: the file is damaged, or a number is none that a time or a pixel can be.
    """
    try:
        table = np.load(path, "r", allow_pickle=False)
    except (*DAMAGED_ARRAY, EOFError) as error:
        raise ValueError(f"Expected arrays of events in {path}, got: {error}") from error
    return read_carla(table.reshape(-1), path, hints)


def tick_files(folder: Path) -> list[Path]:
    """The files of a folder that holds one for each tick, by the numbers in their names.

    Raises:
        ValueError: there is none, or there are several kinds of them.
    """
    files = [path for path in folder.iterdir() if path.suffix.lower() in TICK_SUFFIXES]
    suffixes = sorted({path.suffix.lower() for path in files})
    if len(suffixes) != 1:
        raise ValueError(
            f"Expected a bag of ROS 2 ({METADATA}) or files of one kind with the events of each "
            f"tick ({', '.join(TICK_SUFFIXES)}) in {folder}, got "
            f"{' and '.join(suffixes) or 'neither'}; name a file, or keep one kind"
        )
    return sorted(files, key=lambda path: (_numbers(path), path.name))


def _numbers(path: Path) -> list[int]:
    return [int(digits) for digits in re.findall(r"\d+", path.stem)]
