"""Who may leave the sensor when: the arithmetic of readout.py.

Each function takes the keys of all events that wait or arise before a time, in the order of their
times, and gives the microsecond in which each leaves, or WAITS where that is not before this time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eqs.kernels import njit
from eqs.simulators.streaming.keys import PIXEL_BITS, TIME_SHIFT

Keys = NDArray[np.int64]
Stamps = NDArray[np.int64]

PICOSECONDS = 1_000_000
"""In a microsecond."""
WAITS = -1
_PIXEL_MASK = (1 << PIXEL_BITS) - 1


@njit(cache=True)
def _arises_ps(key: int) -> int:
    return (key >> TIME_SHIFT) * PICOSECONDS


@njit(cache=True)
def _row_of(key: int, width: int) -> int:
    return ((key >> 1) & _PIXEL_MASK) // width


@njit(cache=True, nogil=True)
def one_by_one(keys: Keys, service_ps: int, free_ps: int, until_ps: int) -> tuple[Stamps, int]:
    """Each event at its time, or a service time after the one before; also when the next may."""
    stamps = np.full(keys.size, WAITS)
    for index in range(keys.size):
        now_ps = max(free_ps, _arises_ps(keys[index]))
        if now_ps >= until_ps:
            break
        stamps[index] = now_ps // PICOSECONDS
        free_ps = now_ps + service_ps
    return stamps, free_ps


@njit(cache=True, nogil=True)
def row_by_row(
    keys: Keys, size: tuple[int, int], service_ps: int, free_ps: int, row: int, until_ps: int
) -> tuple[Stamps, int, int]:
    """All that wait in the next row where any wait; also when that may go on, and the last row."""
    height, width = size
    stamps = np.full(keys.size, WAITS)
    # The events that wait in a row: the newest one, and for each one that before it.
    newest, before = np.full(height, -1), np.empty(keys.size, np.int64)
    arisen = waiting = 0
    while waiting or arisen < keys.size:
        now_ps = free_ps if waiting else max(free_ps, _arises_ps(keys[arisen]))
        if now_ps >= until_ps:  # an event not known yet might arise in time for this row
            break
        while arisen < keys.size and _arises_ps(keys[arisen]) <= now_ps:
            at = _row_of(keys[arisen], width)
            before[arisen], newest[at] = newest[at], arisen
            arisen, waiting = arisen + 1, waiting + 1
        row = (row + 1) % height
        while newest[row] < 0:
            row = (row + 1) % height
        while newest[row] >= 0:
            stamps[newest[row]] = now_ps // PICOSECONDS
            newest[row], waiting = before[newest[row]], waiting - 1
        free_ps = now_ps + service_ps
    return stamps, free_ps, row


@njit(cache=True, nogil=True)
def by_the_clock(keys: Keys, size: tuple[int, int], period_ps: int, until_ps: int) -> Stamps:
    """Each event at the next tick that visits its row; tick k visits row k modulo the height."""
    height, width = size
    stamps = np.full(keys.size, WAITS)
    for index in range(keys.size):
        tick = (_arises_ps(keys[index]) + period_ps - 1) // period_ps
        tick += (_row_of(keys[index], width) - tick) % height
        if tick * period_ps < until_ps:
            stamps[index] = tick * period_ps // PICOSECONDS
    return stamps
