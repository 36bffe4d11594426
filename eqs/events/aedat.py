"""AEDAT files of iniVation's cameras and of jAER: versions 2, 3.1 and 4.

Source: the published descriptions of the formats.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.events.decoded import Decoded, unwrapped
from eqs.extras import needed

# Sensors by the name of jAER's chip class.
CHIPS = {
    "DVS128": (128, 128), "DAVIS128": (128, 128), "DAVIS208": (192, 208), "DAVIS240": (180, 240),
    "DAVIS346": (260, 346), "DAVIS640": (480, 640),
}  # fmt: skip
POLARITY, PACKET_HEADER = 1, 28


def read_aedat2(path: Path) -> Decoded:
    """Events of an AEDAT 2.0 file: pairs of address and time, 32 bits each, most significant first.

    Convention: jAER counts rows from the bottom and, for the DVS128, columns from the right; both
    are turned round.

    Raises:
        ValueError: the file names no chip whose addresses are known.
    """
    content = path.read_bytes()
    header, start = _comments(content)
    chip = re.search(r"AEChip: *([\w.]+)", header)
    name = chip[1].rpartition(".")[2].upper() if chip else "none"
    known = [key for key in CHIPS if name.startswith(key)]
    if not known:
        raise ValueError(
            f"Expected AEDAT 2 of {', '.join(CHIPS)} in {path}, got the chip {name}; convert it "
            "with jAER"
        )
    height, width = CHIPS[known[0]]
    body = content[start : start + (len(content) - start) // 8 * 8]
    pairs = np.frombuffer(body, ">u4").reshape(-1, 2).astype(np.int64)
    address, t = pairs[:, 0], unwrapped(pairs[:, 1], 1 << 32)
    if known[0] == "DVS128":
        events = address >> 15 & 1 == 0
        x = width - 1 - (address >> 1 & 0x7F)
        y, p = address >> 8 & 0x7F, 1 - (address & 1)
    else:
        events = (address >> 31 & 1 == 0) & (address >> 10 & 1 == 0)
        x, y, p = address >> 12 & 0x3FF, address >> 22 & 0x1FF, address >> 11 & 1
    y = height - 1 - y
    return Decoded(
        kind=f"an AEDAT 2 file ({name})", t=t[events], x=x[events], y=y[events], p=p[events],
        height=height, width=width,
    )  # fmt: skip


def _comments(content: bytes) -> tuple[str, int]:
    """The lines that begin with `#`, and where the data begin."""
    at = 0
    while content[at : at + 1] == b"#":
        stop = content.find(b"\n", at)
        if stop < 0:
            break
        at = stop + 1
    return content[:at].decode("latin-1"), at


def read_aedat3(path: Path) -> Decoded:
    """Events of an AEDAT 3.1 file: packets of one kind each, the least significant byte first."""
    content = path.read_bytes()
    _, at = _comments(content)
    words: list[NDArray[Any]] = []
    overflows: list[NDArray[np.int64]] = []
    while at + PACKET_HEADER <= len(content):
        kind = int.from_bytes(content[at : at + 2], "little")
        size, _, overflow, _, number, _ = (
            int(each) for each in np.frombuffer(content[at + 4 : at + PACKET_HEADER], "<i4")
        )
        at += PACKET_HEADER
        if size < 1 or number < 0 or at + size * number > len(content):
            break  # a packet that was cut off
        if kind == POLARITY and size == 8:
            part = np.frombuffer(content[at : at + 8 * number], "<u4").reshape(-1, 2)
            words.append(part)
            overflows.append(np.full(len(part), overflow, np.int64))
        at += size * number
    pairs = np.concatenate(words).astype(np.int64) if words else np.zeros((0, 2), np.int64)
    turns = np.concatenate(overflows) if overflows else np.zeros(0, np.int64)
    data = pairs[:, 0]
    valid = data & 1 == 1
    t = (turns << 31) + pairs[:, 1]
    return Decoded(
        kind="an AEDAT 3.1 file", t=t[valid], x=(data >> 17)[valid], y=(data >> 2 & 0x7FFF)[valid],
        p=(data >> 1 & 1)[valid],
    )  # fmt: skip


def read_aedat4(path: Path) -> Decoded:
    """Events of the first event stream of an AEDAT 4 file.

    Raises:
        ValueError: the file holds none, or the optional dependency `aedat4` is not installed.
    """
    with needed("aedat4", f"to read {path}"):
        import aedat
    try:
        decoder = aedat.Decoder(str(path))
        streams = decoder.id_to_stream()
        chosen = [number for number, stream in streams.items() if stream["type"] == "events"]
        if not chosen:
            raise ValueError(f"Expected a stream of events in {path}, got {streams}")
        parts = [
            packet["events"]
            for packet in decoder
            if packet["stream_id"] == chosen[0] and "events" in packet
        ]
    except RuntimeError as error:
        raise ValueError(f"Expected a whole AEDAT 4 file at {path}, got: {error}") from error
    events = np.concatenate(parts) if parts else np.zeros(0, [(n, "<u8") for n in "txyp"])
    size = streams[chosen[0]]
    t = events["t"].astype(np.int64)
    return Decoded(
        kind="an AEDAT 4 file", t=t, x=events["x"], y=events["y"], p=events["p"].astype(np.uint8),
        height=int(size["height"]), width=int(size["width"]),
    )  # fmt: skip
