"""Any event file: what it is, told by its first bytes, and the events that it holds."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import h5py

from eqs.events.aedat import read_aedat2, read_aedat3
from eqs.events.aedat4 import read_aedat4
from eqs.events.atis import HEADER, read_event_stream, read_forty_bits
from eqs.events.bag import BAGS, is_bag_folder
from eqs.events.carla import (
    RAW_SUFFIXES,
    is_carla_array,
    raw_records,
    read_carla,
    read_carla_array,
    tick_files,
)
from eqs.events.decoded import Decoded, joined
from eqs.events.hdf5 import DAMAGE, HDF5
from eqs.events.hints import NOTHING_SAID, Hints
from eqs.events.loaded import LoadedEvents
from eqs.events.matlab import read_matlab
from eqs.events.raw import read_prophesee
from eqs.events.reader import EventReader
from eqs.events.ros import read_bag
from eqs.events.tables import read_foreign_hdf5, read_numpy
from eqs.events.text import read_text

PIECE_BYTES = 1 << 20  # of vectors of events, some six million
READ = (
    "DSEC, v2e, event_utils, MVSEC, M3ED and Metavision HDF5, RAW (EVT2, EVT2.1, EVT3), DAT, "
    "AEDAT 2, 3.1 and 4, Event Stream, ROS bags, arrays of CARLA, 40-bit .bin, "
    "npy, npz, MATLAB, text and CSV"
)


def open_events(
    path: Path | str,
    height: int | None = None,
    width: int | None = None,
    rows: int | None = None,
) -> EventReader | LoadedEvents:
    """A file in the layout of DSEC, read piece by piece, or any other, read whole.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is of no known kind, or damaged, or nobody says its sensor's size.
    """
    if is_dsec(Path(path)):
        return EventReader(path, height, width, rows)
    hints = Hints(height=height, width=width)
    return LoadedEvents(decode(path, hints).events(height, width), rows)


def is_dsec(path: Path) -> bool:
    """Whether a file is HDF5 in the layout of DSEC; one that cannot be opened may be.

    A folder, of a bag or of a simulator's ticks, is not.

    Raises:
        FileNotFoundError: there is no such file.
    """
    if path.is_dir():
        return False
    if first_bytes(path)[:8] != HDF5:
        return path.suffix.lower() in (".h5", ".hdf5")  # whose reader says what is wrong
    try:
        with h5py.File(path) as file:
            return "ms_to_idx" in file
    except DAMAGE:
        return True  # whose reader says what is wrong


def decode(path: Path | str, hints: Hints = NOTHING_SAID) -> Decoded:
    """The events of a file that is not in the layout of DSEC, all at once.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is of no known kind, or damaged, or fits several readings.
    """
    return joined(pieces(path, hints), f"{path}, which holds no event")


def pieces(
    path: Path | str, hints: Hints = NOTHING_SAID, size: int = PIECE_BYTES
) -> Iterator[Decoded]:
    """The events of a file that is not in the layout of DSEC, piece by piece in the file's order.

    Together they are the same whatever the size. Tables of other kinds than text and the HDF5
    files of other programs come in one piece.

    Args:
        path: the file, or the folder of a ROS 2 bag or of the files of CARLA's ticks.
        hints: what the file leaves open.
        size: about how many bytes of the file make a piece.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is of no known kind, or damaged, or fits several readings.
    """
    for part in _pieces(Path(path), hints, size):
        yield replace(part, p=1 - part.p) if hints.invert_polarity else part


def _pieces(path: Path, hints: Hints, size: int) -> Iterator[Decoded]:
    if path.is_dir():
        yield from _of_folder(path, hints, size)
        return
    first = first_bytes(path)
    if first.startswith(BAGS):
        yield from read_bag(path, hints)
    elif first.startswith(b"#!AER-DAT2"):
        yield from read_aedat2(path, size, hints)
    elif first.startswith(b"#!AER-DAT4"):
        yield from read_aedat4(path)
    elif table := _table(first, path):
        yield table(path, hints)
    elif path.suffix.lower() in (".txt", ".csv", ".zip", ".tsv"):
        yield from read_text(path, size, hints)
    elif path.suffix.lower() in RAW_SUFFIXES and (records := raw_records(path)) is not None:
        yield read_carla(records, path, hints)
    elif read := _binary(first, path):
        yield from read(path, size)
    elif path.suffix.lower() == ".dat":
        yield from read_text(path, size, hints)
    else:
        raise ValueError(f"Expected {READ} in {path}, got none of them; convert it")


def _of_folder(folder: Path, hints: Hints, size: int) -> Iterator[Decoded]:
    """The events of a ROS 2 bag, or of a file for each tick; empty files are ticks without any."""
    if is_bag_folder(folder):
        yield from read_bag(folder, hints)
        return
    for path in tick_files(folder):
        if path.stat().st_size:
            yield from _pieces(path, hints, size)


def _table(first: bytes, path: Path) -> Callable[[Path, Hints], Decoded] | None:
    """What reads a table that comes in one piece, if the file is one."""
    if first[:8] == HDF5:
        return read_foreign_hdf5
    if first[:6] == b"\x93NUMPY":
        return read_carla_array if is_carla_array(path) else read_numpy
    if first[:4] == b"PK\x03\x04" and path.suffix == ".npz":
        return read_numpy
    return read_matlab if first.startswith(b"MATLAB ") else None


def _binary(first: bytes, path: Path) -> Callable[[Path, int], Iterator[Decoded]] | None:
    """What reads a small binary format, if the file is of one."""
    for start, read in (
        (b"%", read_prophesee), (b"#!AER-DAT3", read_aedat3), (HEADER, read_event_stream),
    ):  # fmt: skip
        if first.startswith(start):
            return read
    return read_forty_bits if path.suffix == ".bin" else None


def first_bytes(path: Path) -> bytes:
    """What tells most formats from each other.

    Raises:
        FileNotFoundError: there is no such file.
    """
    if not path.is_file():
        raise FileNotFoundError(
            f"Expected an event file at {path}, found none; check data.root, or make the file first"
        )
    with path.open("rb") as file:
        return file.read(32)
