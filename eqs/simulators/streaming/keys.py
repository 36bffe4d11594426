"""Event keys: one int64 per event, and putting them in order.

Kernels write an event as a single number, time above pixel above polarity, so that sorting and
merging move eight bytes per event. Convention: streams are ordered by (t, y, x, ordinal), where the
ordinal is the order in which a pixel fired.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from eqs.events import Events
from eqs.kernels import njit

Keys = NDArray[np.int64]
"""Event keys, or a buffer for them."""

Fired = tuple[Keys, int]
"""A buffer of event keys, and how many of them count."""

PIXEL_BITS = 26  # 67 million pixels
TIME_SHIFT = PIXEL_BITS + 1
MAX_PIXELS = 1 << PIXEL_BITS
MAX_TIME_US = 1 << (62 - TIME_SHIFT)  # nine hours
_DIGIT_BITS = 8
_DIGIT_MASK = (1 << _DIGIT_BITS) - 1
_PIXEL_MASK = (1 << PIXEL_BITS) - 1


@njit(cache=True)
def event_key(time_us: int, pixel: int, polarity: int) -> int:
    """An event as one number; `pixel` counts row by row."""
    return (time_us << TIME_SHIFT) | (pixel << 1) | polarity


@njit(cache=True)
def with_room(keys: NDArray[np.int64], needed: int) -> NDArray[np.int64]:
    """The same keys in a buffer that holds at least `needed`."""
    if needed <= keys.size:
        return keys
    larger = np.empty(max(2 * keys.size, needed), np.int64)
    larger[: keys.size] = keys
    return larger


@njit(cache=True, nogil=True)
def _raster_run(keys: NDArray[np.int64]) -> int:
    """How many keys from the first on were written row by row."""
    previous = -1
    for index in range(keys.size):
        pixel = (keys[index] >> 1) & _PIXEL_MASK
        if pixel < previous:
            return index
        previous = pixel
    return keys.size


@njit(cache=True, nogil=True)
def _radix_sorted(keys: NDArray[np.int64], base: int, lowest_bit: int) -> NDArray[np.int64]:
    """Stable radix sort, in place or not, on what is left of `key - base` above its lowest bits."""
    largest = 0
    for key in keys:
        largest = max(largest, key - base)
    source, target = keys, np.empty_like(keys)
    shift = lowest_bit
    while shift < 63 and largest >> shift:  # a shift by all bits does not give zero
        counts = np.zeros((1 << _DIGIT_BITS) + 1, np.int64)
        for key in source:
            counts[(((key - base) >> shift) & _DIGIT_MASK) + 1] += 1
        for digit in range(_DIGIT_MASK):
            counts[digit + 1] += counts[digit]
        for key in source:
            digit = ((key - base) >> shift) & _DIGIT_MASK
            target[counts[digit]] = key
            counts[digit] += 1
        source, target = target, source
        shift += _DIGIT_BITS
    return source


@njit(cache=True, nogil=True)
def _merged(first: NDArray[np.int64], second: NDArray[np.int64]) -> NDArray[np.int64]:
    """Two sorted runs as one; of equal events those of the first run come first."""
    both = np.empty(first.size + second.size, np.int64)
    taken = 0
    for index in range(both.size):
        left = index - taken
        if taken < second.size and (
            left == first.size or (second[taken] >> 1) < (first[left] >> 1)
        ):
            both[index] = second[taken]
            taken += 1
        else:
            both[index] = first[left]
    return both


@njit(cache=True, nogil=True)
def ordered(keys: NDArray[np.int64], start_us: int) -> NDArray[np.int64]:
    """Sort the keys of one frame interval by (time, pixel); equal ones keep their order.

    Args:
        keys: events in the order in which a kernel wrote them, times not before `start_us`;
            used as scratch.
        start_us: start of the interval on the stream's clock.
    """
    # What was written row by row is sorted by pixel already, and only its times need sorting. A
    # model's noise comes as a second run of rows behind the signal's.
    base = start_us << TIME_SHIFT
    run = _raster_run(keys)
    first, rest = _radix_sorted(keys[:run], base, TIME_SHIFT), keys[run:]
    if rest.size == 0:
        return first
    lowest_bit = TIME_SHIFT if _raster_run(rest) == rest.size else 1
    return _merged(first, _radix_sorted(rest, base, lowest_bit))


class ReorderBuffer:
    """Holds events back until nothing earlier can follow."""

    def __init__(self) -> None:
        """Start with nothing waiting."""
        self.waiting = np.empty(0, np.int64)

    def push(self, keys: NDArray[np.int64], watermark_us: int) -> NDArray[np.int64]:
        """Take sorted events and give back, sorted, all that lie before the watermark."""
        merged = keys
        if len(self.waiting):
            # Only what lies among the waiting events needs merging; the rest follows them.
            overlap = np.searchsorted(keys, (int(self.waiting[-1]) >> TIME_SHIFT) + 1 << TIME_SHIFT)
            both = np.concatenate([self.waiting, keys[:overlap]])
            both = both[np.argsort(both >> 1, kind="stable")]
            merged = np.concatenate([both, keys[overlap:]])
        ready = int(np.searchsorted(merged, watermark_us << TIME_SHIFT))
        self.waiting = merged[ready:].copy()
        return merged[:ready]

    def flush(self) -> NDArray[np.int64]:
        """All that still waits."""
        rest, self.waiting = self.waiting, np.empty(0, np.int64)
        return rest


@njit(cache=True, nogil=True)
def _unpack(
    keys: NDArray[np.int64],
    width: int,
    origin_us: int,
    t: NDArray[np.int64],
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    p: NDArray[np.uint8],
) -> None:
    columns = np.uint32(width)
    for index in range(keys.size):
        key = keys[index]
        pixel = np.uint32((key >> 1) & _PIXEL_MASK)
        row = pixel // columns
        t[index] = (key >> TIME_SHIFT) + origin_us
        x[index] = pixel - row * columns
        y[index] = row
        p[index] = key & 1


def events_of(
    parts: Sequence[NDArray[np.int64]], height: int, width: int, origin_us: int
) -> Events:
    """The events that sorted keys stand for, on a clock on which the stream began at `origin_us`.

    Args:
        parts: keys in order, in one array or in several that follow each other.
        height: rows of the sensor.
        width: its columns.
        origin_us: time of the key's time zero.

    Example:
        >>> keys = np.array([event_key(7, 5, 1)])
        >>> events = events_of([keys], height=2, width=4, origin_us=100)
        >>> [int(value[0]) for value in (events.t, events.x, events.y, events.p)]
        [107, 1, 1, 1]
    """
    count = sum(map(len, parts))
    t, p = np.empty(count, np.int64), np.empty(count, np.uint8)
    x, y = np.empty(count, np.uint16), np.empty(count, np.uint16)
    first = 0
    for keys in parts:
        own = slice(first, first + len(keys))
        _unpack(keys, width, origin_us, t[own], x[own], y[own], p[own])
        first = own.stop
    return Events(t, x, y, p, height, width)
