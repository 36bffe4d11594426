"""AEDAT files of iniVation's cameras and of jAER: versions 2 and 3.1.

Source: the published descriptions of the formats.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from eqs.events.decoded import Clock, Decoded, blocks
from eqs.events.hints import Hints

# Sensors by the name of jAER's chip class.
CHIPS = {
    "DVS128": (128, 128), "DAVIS128": (128, 128), "DAVIS208": (192, 208), "DAVIS240": (180, 240),
    "DAVIS346": (260, 346), "DAVIS640": (480, 640),
}  # fmt: skip
DAVIS: dict[str, Any] = {"x": (12, 0x3FF), "y": (22, 0x1FF), "polarity": 11}
V2E, SIZES_OF_V2E = "AEDat2Output in v2e", ((260, 346), (180, 240), (480, 640))
POLARITY, PACKET_HEADER, LONGEST_HEADER = 1, 28, 1 << 20


def read_aedat2(path: Path, size: int, hints: Hints) -> Iterator[Decoded]:
    """Events of an AEDAT 2.0 file: pairs of address and time, 32 bits each, most significant first.

    Convention: jAER counts rows from the bottom and, for the DVS128, columns from the right; both
    are turned round. Files that v2e wrote count columns from the right as well, and say so by
    naming v2e instead of a chip.

    Raises:
        ValueError: the file names no chip whose addresses are known, or nobody says the sensor of a
            file of v2e.
    """
    with path.open("rb") as file:
        header, start = _comments(file)
        chip = _chip(header, path, hints)
        clock = Clock(1 << 32)
        file.seek(start)
        for content in blocks(file, size, 8):
            pairs = np.frombuffer(content, ">u4").reshape(-1, 2).astype(np.uint32)
            address, t = pairs[:, 0].astype(np.int64), clock.counted(pairs[:, 1])
            kept = address & chip.others == 0
            t, address = t[kept], address[kept]
            x, y = (address >> at & most for at, most in (chip.x, chip.y))
            yield Decoded(
                kind=f"an AEDAT 2 file ({chip.name})", t=t,
                x=chip.width - 1 - x if chip.flips_x else x, y=chip.height - 1 - y,
                p=(address >> chip.polarity & 1) ^ chip.inverts, height=chip.height,
                width=chip.width,
            )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Chip:
    """Where an address has what: the lowest bit of column and row, and their masks.

    Args:
        name: what the file calls it.
        height: rows of the sensor.
        width: columns of the sensor.
        x: lowest bit and mask of the column.
        y: lowest bit and mask of the row.
        polarity: bit of the polarity.
        others: bits that mark what is no event of brightness.
        inverts: whether 1 is darker.
        flips_x: whether columns count from the right.
    """

    name: str
    height: int
    width: int
    x: tuple[int, int]
    y: tuple[int, int]
    polarity: int
    others: int
    inverts: bool = False
    flips_x: bool = False


def _chip(header: str, path: Path, hints: Hints) -> Chip:
    found = re.search(r"AEChip: *([\w.]+)", header)
    name = found[1].rpartition(".")[2].upper() if found else "none"
    if found is None and V2E in header:
        return _chip_of_v2e(header, path, hints)
    known = [key for key in CHIPS if name.startswith(key)]
    if not known:
        raise ValueError(
            f"Expected AEDAT 2 of {', '.join(CHIPS)} in {path}, got the chip {name}; convert it "
            "with jAER"
        )
    height, width = CHIPS[known[0]]
    if known[0] == "DVS128":
        return Chip(
            name=name, height=height, width=width, x=(1, 0x7F), y=(8, 0x7F), polarity=0,
            others=1 << 15, inverts=True, flips_x=True,
        )  # fmt: skip
    return Chip(name=name, height=height, width=width, others=1 << 31 | 1 << 10, **DAVIS)


def _chip_of_v2e(header: str, path: Path, hints: Hints) -> Chip:
    """The sensor that v2e wrote for, whose size decides over the addresses and is not in the file.

    Where v2e labels noise it marks events of noise as special; they are events all the same.
    """
    size = (hints.height, hints.width)
    if size not in SIZES_OF_V2E:
        raise ValueError(
            f"Expected to know the sensor that v2e wrote {path} for, 346x260, 240x180 or 640x480, "
            f"got {'none' if None in size else f'{size[1]}x{size[0]}'}; set height and width"
        )
    places = DAVIS
    if size == (480, 640):
        if "noise events are labeled" in header:
            raise ValueError(
                f"Expected columns of their own bits in {path}, got such that v2e's labels of "
                "noise wrote over; simulate without --label_signal_noise"
            )
        places = {"x": (1, 0x3FF), "y": (11, 0x3FF), "polarity": 0}
    return Chip(
        name="v2e", height=size[0] or 0, width=size[1] or 0, others=0, flips_x=True, **places
    )


def _comments(file: BinaryIO) -> tuple[str, int]:
    """The lines that begin with `#`, and where the data begin."""
    content = file.read(LONGEST_HEADER)
    at = 0
    while content[at : at + 1] == b"#":
        stop = content.find(b"\n", at)
        if stop < 0:
            break
        at = stop + 1
    return content[:at].decode("latin-1"), at


def read_aedat3(path: Path, size: int) -> Iterator[Decoded]:
    """Events of an AEDAT 3.1 file: packets of one kind each, the least significant byte first.

    A packet that was cut off is left out.
    """
    length = path.stat().st_size
    with path.open("rb") as file:
        _, start = _comments(file)
        file.seek(start)
        yield _valid(b"", 0)
        while len(head := file.read(PACKET_HEADER)) == PACKET_HEADER:
            kind = int.from_bytes(head[:2], "little")
            each, _, overflow, _, number, _ = np.frombuffer(head, "<i4", 6, 4).tolist()
            stop = file.tell() + each * number
            if each < 1 or number < 0 or stop > length:
                return
            if kind == POLARITY and each == 8:
                step = max(size // 8, 1) * 8
                for at in range(file.tell(), stop, step):
                    yield _valid(file.read(min(step, stop - at)), overflow)
            file.seek(stop)


def _valid(content: bytes, overflow: int) -> Decoded:
    """Events of a packet whose clock has begun again so many times."""
    pairs = np.frombuffer(content, "<u4").reshape(-1, 2)
    pairs = pairs[pairs[:, 0] & 1 == 1]
    data = pairs[:, 0]
    return Decoded(
        kind="an AEDAT 3.1 file", t=(overflow << 31) + pairs[:, 1].astype(np.int64),
        x=data >> 17, y=data >> 2 & 0x7FFF, p=data >> 1 & 1,
    )  # fmt: skip
