"""Where a signal that is linear within a frame interval crosses a pixel's levels.

The reference `r` is the level at which a pixel last fired; the next ones lie at `r + j C`,
j = 1, 2, ..., towards the signal. Two rules exist for which of them fire. The robust rule fires
all that the signal has passed at the end of the interval, those overdue already at its start at
once. The official rule (rpg_esim and its descendants) accepts a level only if it lies beyond the
signal at the start, so that a pixel whose reference was moved from outside falls mute.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eqs.kernels import njit
from eqs.simulators.streaming.keys import event_key

# A signal counts as having reached a level it misses by this share of a threshold, so that a step
# of exactly n thresholds gives n events whichever way the sum was rounded.
RELATIVE_TOLERANCE = 1e-9
_ALMOST_ONE = 1.0 - RELATIVE_TOLERANCE
SMALLEST_CHANGE_LOG = 1e-6


@njit(cache=True)
def levels_passed(difference: float, threshold_on: float, threshold_off: float) -> int:
    """Signed number of levels between the reference and a signal `difference` above it.

    Example:
        >>> levels_passed(0.7, 0.2, 0.3), levels_passed(-0.6, 0.2, 0.3)
        (3, -2)
    """
    step = threshold_on if difference > 0 else -threshold_off
    levels = int(difference / step + RELATIVE_TOLERANCE)
    return levels if difference > 0 else -levels


@njit(cache=True, nogil=True)
def firing_pixels(
    difference: NDArray[np.float64],
    threshold_on: NDArray[np.float64],
    threshold_off: NDArray[np.float64],
    chosen: NDArray[np.int32],
    passed: NDArray[np.int64],
) -> tuple[int, int]:
    """List the pixels that have passed a level, and how many levels each.

    Args:
        difference: signal above reference of each pixel.
        threshold_on: threshold of each pixel.
        threshold_off: the same for OFF, positive.
        chosen: filled with the pixels, in rising order; a place for each.
        passed: filled with their signed numbers of levels; as long as `chosen`.

    Returns:
        How many pixels are listed, and how many levels they have passed in all.
    """
    count = 0
    for pixel in range(difference.size):  # without a branch, as few pixels fire
        chosen[count] = pixel
        above = difference[pixel] >= threshold_on[pixel] * _ALMOST_ONE
        below = difference[pixel] <= -threshold_off[pixel] * _ALMOST_ONE
        count += int(above | below)
    total = 0
    for index in range(count):
        pixel = chosen[index]
        levels = levels_passed(difference[pixel], threshold_on[pixel], threshold_off[pixel])
        passed[index] = levels
        total += abs(levels)
    return count, total


@njit(cache=True)
def crossing_share(level: float, first: float, last: float) -> float:
    """Share of the interval, 0..1, at which a signal from `first` to `last` crosses `level`.

    Example:
        >>> crossing_share(0.5, 0.0, 2.0), crossing_share(-1.0, 0.0, 2.0), crossing_share(1, 1, 1)
        (0.25, 0.0, 0.0)
    """
    if first == last:
        return 0.0
    return min(max((level - first) / (last - first), 0.0), 1.0)


@njit(cache=True)
def officially_crossed(level: float, first: float, last: float, sign: int) -> bool:
    """Whether the official rule accepts a level for a signal moving from `first` to `last`."""
    return sign * (level - first) > 0.0 and sign * (last - level) >= 0.0


@njit(cache=True, nogil=True)
def fire_levels(
    chosen: NDArray[np.int32],
    passed: NDArray[np.int64],
    above: NDArray[np.float64],
    moved: NDArray[np.float64],
    last_us: NDArray[np.float64],
    on: NDArray[np.float64],
    off: NDArray[np.float64],
    refractory_us: float,
    keeps_contrast: bool,
    start_us: int,
    span_us: int,
    keys: NDArray[np.int64],
) -> int:
    """Fire the levels between `above` and `moved` by the robust rule, and take them from `moved`.

    Args:
        chosen: the pixels that fire, see `firing_pixels`.
        passed: how many levels each of them has passed, signed.
        above: signal above reference of each pixel when the interval starts.
        moved: the same when it ends; reduced by what has fired.
        last_us: time of each pixel's last event; updated.
        on: threshold of each pixel.
        off: the same for OFF, positive.
        refractory_us: refractory period after an event.
        keeps_contrast: whether a crossing within the refractory period waits for its end or is
            lost.
        start_us: start of the interval.
        span_us: its length.
        keys: buffer for the events, large enough for all levels passed.

    Returns:
        The number of events.
    """
    count = 0
    for index in range(chosen.size):
        pixel, levels = chosen[index], passed[index]
        polarity = 1 if levels > 0 else 0
        # Both are read, as choosing between two numbers costs no branch.
        up, down = on[pixel], -off[pixel]
        step = up if levels > 0 else down
        first, last, previous_us = above[pixel], moved[pixel], last_us[pixel] - start_us
        settled = 0
        for ordinal in range(1, abs(levels) + 1):
            offset_us = crossing_share(ordinal * step, first, last) * span_us
            earliest_us = previous_us + refractory_us
            if offset_us < earliest_us:
                if not keeps_contrast:
                    settled = ordinal
                    continue
                # The signal is still beyond the level when the refractory period ends.
                offset_us = earliest_us
            if offset_us > span_us:
                break
            previous_us = offset_us
            settled = ordinal
            keys[count] = event_key(start_us + int(offset_us), pixel, polarity)
            count += 1
        moved[pixel] = last - settled * step
        last_us[pixel] = start_us + previous_us
    return count
