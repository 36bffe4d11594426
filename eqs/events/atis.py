"""Event Stream files, and the 40-bit binaries of N-MNIST and N-Caltech101."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from eqs.events.decoded import Decoded

HEADER = b"Event Stream"
DVS = 1
OVERFLOW_ROW, OVERFLOW_US = 240, 1 << 13


def read_event_stream(path: Path) -> Decoded:
    """Events of an Event Stream file of version 2, kind DVS.

    Convention: the format counts rows from the bottom; they are turned round.

    Raises:
        ValueError: the file is of another version or kind.
    """
    content = np.frombuffer(path.read_bytes(), np.uint8)
    version, kind = (int(each) for each in content[[12, 15]]) if len(content) > 20 else (0, 0)
    if version != 2 or kind != DVS:
        raise ValueError(
            f"Expected an Event Stream of version 2 and kind 1 (DVS) in {path}, got version "
            f"{version} and kind {kind}; convert it to one of these"
        )
    width, height = (int(content[at]) + 256 * int(content[at + 1]) for at in (16, 18))
    t, x, y, p = _event_stream(content[20:])
    return Decoded(
        kind="an Event Stream file", t=t, x=x, y=height - 1 - y, p=p, height=height, width=width
    )


@numba.njit(cache=True)
def _event_stream(content: NDArray[np.uint8]) -> tuple[Any, ...]:
    most = len(content) // 5
    t, x = np.empty(most, np.int64), np.empty(most, np.int64)
    y, p = np.empty(most, np.int64), np.empty(most, np.uint8)
    at = count = 0
    now = 0
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
            break  # an event that was cut off
    return t[:count], x[:count], y[:count], p[:count]


def read_forty_bits(path: Path) -> Decoded:
    """Events of 40 bits: x, y, polarity and 23 bits of time, most significant first.

    Row 240 is no event: it says that the times after it count on from 8.192 ms later.

    Raises:
        ValueError: the file is not made of whole events.
    """
    content = np.frombuffer(path.read_bytes(), np.uint8)
    if len(content) % 5:
        raise ValueError(f"Expected whole events of 5 bytes in {path}, got {len(content)} bytes")
    parts = content.reshape(-1, 5).astype(np.int64)
    over = parts[:, 1] == OVERFLOW_ROW
    t = (parts[:, 2] & 0x7F) << 16 | parts[:, 3] << 8 | parts[:, 4]
    t += OVERFLOW_US * np.cumsum(over)
    kept = parts[~over]
    return Decoded(
        kind="a file of 40-bit events", t=t[~over], x=kept[:, 0], y=kept[:, 1], p=kept[:, 2] >> 7
    )
