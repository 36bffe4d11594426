"""Event Stream files, and the 40-bit binaries of N-MNIST and N-Caltech101."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.events.decoded import Decoded, blocks
from eqs.events.words import room
from eqs.kernels import njit

HEADER, HEADER_BYTES = b"Event Stream", 20
DVS = 1
OVERFLOW_ROW, OVERFLOW_US = 240, 1 << 13


def read_event_stream(path: Path, size: int) -> Iterator[Decoded]:
    """Events of an Event Stream file of version 2, kind DVS, about `size` bytes at a time.

    Convention: the format counts rows from the bottom (so says its authors' library, sepia, of the
    events it reads and writes; the description of the format says nothing); they are turned round.

    Raises:
        ValueError: the file is of another version or kind.
    """
    with path.open("rb") as file:
        header = file.read(HEADER_BYTES)
        version, kind = (header[12], header[15]) if len(header) == HEADER_BYTES else (0, 0)
        if version != 2 or kind != DVS:
            raise ValueError(
                f"Expected an Event Stream of version 2 and kind 1 (DVS) in {path}, got version "
                f"{version} and kind {kind}; convert it to one of these"
            )
        width, height = np.frombuffer(header, "<u2", 2, 16).tolist()
        now, rest = 0, b""
        for block in blocks(file, size, 1):
            content = np.frombuffer(rest + block, np.uint8)
            t, x, y, p, now, read = _event_stream(content, now)
            rest = content[read:].tobytes()
            yield Decoded(
                kind="an Event Stream file", t=t, x=x, y=height - 1 - y.astype(np.int32), p=p,
                height=height, width=width,
            )  # fmt: skip


@njit(cache=True)
def _event_stream(content: NDArray[np.uint8], now: int) -> tuple[Any, ...]:
    """Events, the time of the last one, and how many bytes they took."""
    t, x, y, p = room(len(content) // 5)
    at = count = 0
    while at < len(content):
        first = content[at]
        if first == 0xFE:  # a reader that joins late begins anew
            at += 1
        elif first == 0xFF:  # no event for so long
            now += 127
            at += 1
        elif at + 5 <= len(content):
            now += first >> 1
            t[count], p[count] = now, first & 1
            x[count] = content[at + 1] + 256 * np.int64(content[at + 2])
            y[count] = content[at + 3] + 256 * np.int64(content[at + 4])
            count += 1
            at += 5
        else:
            break  # an event whose rest is yet to come
    return t[:count], x[:count], y[:count], p[:count], now, at


def read_forty_bits(path: Path, size: int) -> Iterator[Decoded]:
    """Events of 40 bits: x, y, polarity and 23 bits of time, most significant first.

    Row 240 is no event: it says that the times after it count on from 8.192 ms later.

    Raises:
        ValueError: the file is not made of whole events.
    """
    length = path.stat().st_size
    if length % 5:
        raise ValueError(f"Expected whole events of 5 bytes in {path}, got {length} bytes")
    counted_on = 0
    with path.open("rb") as file:
        for content in blocks(file, size, 5):
            parts = np.frombuffer(content, np.uint8).reshape(-1, 5)
            over = parts[:, 1] == OVERFLOW_ROW
            turns = counted_on + np.cumsum(over)
            counted_on = int(turns[-1]) if len(turns) else counted_on
            wide = parts[:, 2:].astype(np.int64)
            t = (wide[:, 0] & 0x7F) << 16 | wide[:, 1] << 8 | wide[:, 2]
            t, kept = (t + OVERFLOW_US * turns)[~over], parts[~over]
            yield Decoded(
                kind="a file of 40-bit events", t=t, x=kept[:, 0], y=kept[:, 1], p=kept[:, 2] >> 7
            )
