"""Encodings whose words each change one thing: a time, a row, a column, or bring events.

The functions here are compiled and go from word to word. What a later word needs of an earlier one
they keep in a state, so a stream may be given in pieces of any length.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.kernels import njit

# Places in a state, whose values are -1 as long as no word has told them.
HIGH, TOLD, LOW, ROW, COLUMN, POLARITY, PLACES = range(7)
OUTSIDE = 65535  # of every sensor: what counts further than it stays there
Whole = int | np.int64
Columns = tuple[NDArray[np.int64], NDArray[np.uint16], NDArray[np.uint16], NDArray[np.uint8]]
Arrays = tuple[NDArray[np.int64], NDArray[np.uint16], NDArray[np.uint16], NDArray[np.uint8], int]


def untold() -> NDArray[np.int64]:
    """The state before the first word."""
    return np.full(PLACES, -1, np.int64)


@njit(cache=True)
def room(most: int) -> tuple[Any, ...]:
    """Arrays for so many events."""
    places = np.empty((2, most), np.uint16)
    return np.empty(most, np.int64), places[0], places[1], np.empty(most, np.uint8)


@njit(cache=True)
def bits_in(value: Whole) -> int:
    """Number of bits that are set."""
    count = 0
    while value:
        value &= value - 1
        count += 1
    return count


@njit(cache=True)
def put(
    events: Columns, count: Whole, lanes: tuple[Whole, Whole], now: Whole, across: Whole, lit: Whole
) -> int:
    """Write one event for every bit of a mask, and give the new count.

    Args:
        events: arrays for times, for what the lanes count, for what they share, for polarities.
        count: events so far.
        lanes: the mask, and the place of its lowest bit.
        now: the time.
        across: the place that the lanes share.
        lit: the polarity.
    """
    t, along, shared, p = events
    mask, place = lanes
    while mask:
        if mask & 1:
            t[count], p[count], shared[count] = now, lit, across
            along[count] = min(place, OUTSIDE)
            count += 1
        mask >>= 1
        place += 1
    return int(count)


@njit(cache=True)
def libcaer_cmp(words: NDArray[np.uint16], state: NDArray[np.int64]) -> Arrays:
    """Words of 16 bits of one packet; times count from the packet's base, in microseconds.

    The kind is in the top 4 bits: 0 time high and 1 time low (12 bits each), 2 column (11 bits),
    3 one event's row (11 bits) and polarity (bit 11), 4 a first row and polarity, 5 a mask of 8
    rows from there on, which moves the first row by 8.
    """
    most = 0
    for each in words:
        most += 1 if each >> 12 == 3 else bits_in(each & 0xFF) if each >> 12 == 5 else 0
    t, x, y, p = room(most)
    now: Whole = 0  # every packet tells its time anew
    count = dropped = 0
    column, row, polarity = state[COLUMN], state[ROW], state[POLARITY]
    for each in words:
        kind, value = each >> 12, np.int64(each & 0xFFF)
        if kind == 0:
            now = value << 12 | now & 0xFFF
        elif kind == 1:
            now = now >> 12 << 12 | value
        elif kind == 2:
            column = value & 0x7FF
        elif kind == 4:
            row, polarity = value & 0x7FF, value >> 11
        elif (kind == 3 or kind == 5) and (column < 0 or (kind == 5 and row < 0)):
            dropped += 1
        elif kind == 3:
            count = put((t, y, x, p), count, (1, value & 0x7FF), now, column, value >> 11)
        elif kind == 5:
            count = put((t, y, x, p), count, (value & 0xFF, row), now, column, polarity)
            row += 8
    state[COLUMN], state[ROW], state[POLARITY] = column, row, polarity
    return t[:count], x[:count], y[:count], p[:count], dropped


@njit(cache=True)
def counted(told: Whole, last: Whole, high: Whole, bits: int) -> Whole:
    """A time high of so many bits, counted on from the last: a fall of half its range is a turn."""
    if last < 0:
        return told
    step = told - last
    half = 1 << (bits - 1)
    return high + step + ((1 << bits) if step < -half else -(1 << bits) if step > half else 0)


@njit(cache=True)
def evt2(words: NDArray[np.uint32], state: NDArray[np.int64]) -> Arrays:
    """Words of 32 bits: time high (28 bits of 64 us), or one event with 6 bits of time."""
    most = 0
    for word in words:
        most += word >> 28 <= 1
    t, x, y, p = room(most)
    count = dropped = 0
    high, last = state[HIGH], state[TOLD]
    for each in words:
        word = np.int64(each)
        kind = word >> 28
        if kind == 8:
            told = word & 0x0FFFFFFF
            high = counted(told, last, high, 28)
            last = told
        elif kind <= 1 and last < 0:
            dropped += 1
        elif kind <= 1:
            t[count], p[count] = high << 6 | word >> 22 & 0x3F, kind
            x[count], y[count] = word >> 11 & 0x7FF, word & 0x7FF
            count += 1
    state[HIGH], state[TOLD] = high, last
    return t[:count], x[:count], y[:count], p[:count], dropped


@njit(cache=True)
def evt21(words: NDArray[np.uint64], state: NDArray[np.int64]) -> Arrays:
    """Words of 64 bits: time high, or up to 32 events of one row and one time."""
    most = 0
    for each in words:
        word = np.int64(each)
        most += bits_in(word & 0xFFFFFFFF) if word >> 60 & 15 <= 1 else 0
    t, x, y, p = room(most)
    count = dropped = 0
    high, last = state[HIGH], state[TOLD]
    for each in words:
        word = np.int64(each)
        kind = word >> 60 & 15
        if kind == 8:
            told = word >> 32 & 0x0FFFFFFF
            high = counted(told, last, high, 28)
            last = told
        elif kind <= 1 and last < 0:
            dropped += 1
        elif kind <= 1:
            lanes = (word & 0xFFFFFFFF, word >> 43 & 0x7FF)
            now = high << 6 | word >> 54 & 0x3F
            count = put((t, x, y, p), count, lanes, now, word >> 32 & 0x7FF, kind)
    state[HIGH], state[TOLD] = high, last
    return t[:count], x[:count], y[:count], p[:count], dropped


@njit(cache=True)
def events_in(words: NDArray[np.uint16]) -> int:
    """How many events words of EVT3 bring at most."""
    most = 0
    for each in words:
        kind = each >> 12
        if kind == 4 or kind == 5:
            most += bits_in(each & (0xFFF if kind == 4 else 0xFF))
        else:
            most += kind == 2
    return most


@njit(cache=True)
def evt3(words: NDArray[np.uint16], state: NDArray[np.int64]) -> Arrays:
    """Words of 16 bits that each change one thing: row, time, base column, or bring events.

    Every vector moves the base on by its lanes. Another time high than before brings a low of zero
    until the next low is told.
    """
    t, x, y, p = room(events_in(words))
    count = dropped = 0
    high, last, low = state[HIGH], state[TOLD], max(state[LOW], 0)
    row, base, polarity = state[ROW], state[COLUMN], state[POLARITY]
    for each in words:
        kind, value = each >> 12, np.int64(each & 0xFFF)
        vector = kind == 4 or kind == 5
        if kind == 0:
            row = value & 0x7FF
        elif kind == 3:
            base, polarity = value & 0x7FF, value >> 11
        elif kind == 6:
            low = value
        elif kind == 8:
            high, low = counted(value, last, high, 12), low if value == last else 0
            last = value
        elif (kind == 2 or vector) and (last < 0 or row < 0 or (vector and base < 0)):
            dropped += 1
        elif kind == 2:
            single = (1, value & 0x7FF)
            count = put((t, x, y, p), count, single, high << 12 | low, row, value >> 11)
        elif vector:
            lanes = (value if kind == 4 else value & 0xFF, base)
            count = put((t, x, y, p), count, lanes, high << 12 | low, row, polarity)
        if vector and base >= 0:
            base += 12 if kind == 4 else 8
    state[HIGH], state[TOLD], state[LOW] = high, last, low
    state[ROW], state[COLUMN], state[POLARITY] = row, base, polarity
    return t[:count], x[:count], y[:count], p[:count], dropped
