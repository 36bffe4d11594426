"""Events from expected counts: each pixel integrates them and fires at whole numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.kernels import njit
from eqs.simulators.streaming.keys import Fired, event_key, with_room


@njit(cache=True, nogil=True)
def integrate_and_fire(
    counts: NDArray[Any],
    phases: NDArray[np.float64],
    start_us: int,
    span_us: int,
    keys: NDArray[np.int64],
) -> Fired:
    """Events of an interval cut into equal bins, and the phases at its end.

    The expected counts of a pixel and polarity add up from its phase, evenly within a bin, and an
    event falls where the sum reaches a whole number. The sum's fraction is the next phase, so no
    expectation is lost; with phases drawn evenly from [0, 1) the mean number of events is what is
    expected. Expected counts of `change / threshold` are a level-crossing pixel, exactly.

    Args:
        counts: expected events, OFF before ON, shape (2, bins, pixels).
        phases: from 0 to below 1, shape (2, pixels); moved on.
        start_us: start of the interval.
        span_us: its length.
        keys: buffer for the events.

    Example:
        >>> counts, phases = np.zeros((2, 2, 1)), np.zeros((2, 1))
        >>> counts[1] = 1.25  # five halves of an ON event in two bins
        >>> keys, count = integrate_and_fire(counts, phases, 0, 1000, np.empty(4, np.int64))
        >>> (keys[:count] >> 27).tolist(), phases[1].tolist()
        ([400, 800], [0.5])
    """
    count, bins = 0, counts.shape[1]
    for pixel in range(counts.shape[2]):
        for polarity in range(2):
            total = phases[polarity, pixel]
            for index in range(bins):
                expected = counts[polarity, index, pixel]
                reached = total + expected
                fired = int(reached)
                keys = with_room(keys, count + fired)
                for ordinal in range(1, fired + 1):
                    share = min((ordinal - total) / expected, 1.0)
                    time_us = start_us + int((index + share) * span_us / bins)
                    keys[count] = event_key(time_us, pixel, polarity)
                    count += 1
                total = reached - fired
            phases[polarity, pixel] = total
    return keys, count
