"""The compressed packets of iniVation cameras in ROS, `libcaer_cmp`.

Source: the description of `event_camera_msgs` and the layout that it refers to: words of 16 bits,
least significant byte first, of which the top four say what the others are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.events.decoded import last_before

TIME_HIGH, TIME_LOW, COLUMN, EVENT, BASE, LANES = range(6)

Arrays = tuple[NDArray[np.int64], NDArray[Any], NDArray[Any], NDArray[Any], int]


def compressed_caer(packets: Sequence[bytes], bases_ns: Sequence[int]) -> Arrays:
    """Events of packets, in their order.

    Convention: times begin anew in every packet and count from its base; column and vector base
    stay as they were. A vector holds eight rows above its base and moves the base on.

    Args:
        packets: the packets' bytes.
        bases_ns: the time that each packet counts from, nanoseconds.

    Returns:
        Times in microseconds, columns, rows, polarities, and how many events had no column yet.
    """
    whole = [packet[: len(packet) // 2 * 2] for packet in packets]
    words = np.frombuffer(b"".join(whole), "<u2").astype(np.int64)
    counts = np.array([len(packet) // 2 for packet in whole], np.int64)
    packet = np.repeat(np.arange(len(counts)), counts)
    begins = (np.cumsum(counts) - counts)[packet]
    kinds, value = words >> 12, words & 0xFFF
    told = {kind: last_before(kinds == kind) for kind in (TIME_HIGH, TIME_LOW, COLUMN, BASE)}
    high, low = (
        np.where(told[kind] >= begins, value[told[kind]], 0) for kind in (TIME_HIGH, TIME_LOW)
    )
    times = np.asarray(bases_ns, np.int64)[packet] // 1000 + (high << 12 | low)
    vectors = kinds == LANES
    moved = np.cumsum(vectors) - vectors
    offset = 8 * np.where(told[BASE] >= 0, moved - moved[told[BASE]], 0)
    single = kinds == EVENT
    one = np.flatnonzero(single & (told[COLUMN] >= 0))
    many = np.flatnonzero(vectors & (told[COLUMN] >= 0) & (told[BASE] >= 0))
    which, lane = np.nonzero((value[many][:, None] >> np.arange(8) & 1).astype(bool))
    dropped = int(single.sum() + vectors.sum()) - len(one) - len(many)
    many = many[which]
    index = np.concatenate([one, many])
    based = value[told[BASE][many]]
    y = np.concatenate([value[one] & 0x7FF, (based & 0x7FF) + offset[many] + lane])
    p = np.concatenate([value[one] >> 11, based >> 11])
    order = np.argsort(index, kind="stable")
    index = index[order]
    x = value[told[COLUMN][index]] & 0x7FF
    return times[index], x, y[order], p[order], dropped
