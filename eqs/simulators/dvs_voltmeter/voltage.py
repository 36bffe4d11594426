"""Voltages that drift and diffuse between two barriers, over one frame interval.

Few pixels fire in an interval. Those that certainly do not are moved together, in loops without
branches, which processors run several pixels at a time; the others are moved one by one. Both ways
use the same draws and formulas, so a pixel's voltage does not depend on which it went.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eqs.kernels import njit
from eqs.simulators.dvs_voltmeter.passage import (
    CERTAIN,
    chance_of_on,
    exponents,
    inverse_gaussian,
    passage_time,
)
from eqs.simulators.pixel.randomness import layered_size, mixed, uniform, word_at
from eqs.simulators.streaming.keys import Fired, event_key, with_room

_RUN = 256  # pixels whose intermediate numbers stay in the nearest cache

Seen = tuple[NDArray[Any], NDArray[np.float64]]
"""Codes of an image, and its grey level for each code."""


class Motion(NamedTuple):
    """What turns light into drift and spread; see `DVSVoltmeter`."""

    gain: float
    dark_level: float
    leak_per_us: float
    light_leak_per_us: float
    photon_noise_per_sqrt_us: float
    thermal_noise_per_sqrt_us: float


# A division by zero gives an infinite number here instead of an error, which would be a branch.
@njit(cache=True, nogil=True, error_model="numpy")
def drift_and_spread(
    first: float, last: float, span_us: int, motion: Motion
) -> tuple[float, float]:
    """Drift per microsecond and spread per root of it, between two grey levels.

    Example:
        >>> drift_and_spread(90.0, 110.0, 1, Motion(6.4, 28.0, 0.0, 0.0, 0.0, 0.0))
        (1.0, 0.0)
    """
    light = 0.5 * (first + last)
    relative = 1.0 / (light + motion.dark_level)
    contrast_per_us = motion.gain / span_us * (last - first) * relative
    drift = contrast_per_us + motion.leak_per_us + motion.light_leak_per_us * light
    photon_noise = motion.photon_noise_per_sqrt_us * math.sqrt(light) * relative
    return drift, photon_noise + motion.thermal_noise_per_sqrt_us


@njit(cache=True, nogil=True)
def move_quiet(
    start: Seen,
    end: Seen,
    voltage: NDArray[np.float64],
    motion: Motion,
    frame_key: np.uint64,
    span_us: int,
    others: NDArray[np.int32],
) -> int:
    """Move the pixels that certainly do not fire, and list the others.

    Args:
        start: the image at the start of the interval.
        end: the image at its end.
        voltage: of each pixel, between the barriers -1 and 1; updated.
        motion: what drives it.
        frame_key: family of draws of this interval.
        span_us: its length.
        others: filled with the pixels left to `fire`, in rising order; a place for each.

    Returns:
        How many pixels are listed.
    """
    first, last = np.empty(_RUN), np.empty(_RUN)
    size, share, moved = np.empty(_RUN), np.empty(_RUN), np.empty(_RUN)
    count = 0
    for top in range(0, voltage.size, _RUN):
        level = voltage[top : top + _RUN]
        for index in range(level.size):
            first[index] = start[1][start[0][top + index]]
            last[index] = end[1][end[0][top + index]]
        _draw(frame_key, top, size, share)
        _move(first, last, size, share, level, motion, span_us, moved)
        for index in range(level.size):
            quiet = not math.isnan(moved[index])
            level[index] = moved[index] if quiet else level[index]
            others[count] = top + index
            count += int(not quiet)
    return count


@njit(cache=True, nogil=True)
def _draw(
    frame_key: np.uint64, first_pixel: int, size: NDArray[np.float64], share: NDArray[np.float64]
) -> None:
    """The draws of the first passage, as `passage_time` makes them; NaN where it draws further."""
    for index in range(size.size):
        word = word_at(frame_key, first_pixel + index)
        size[index] = layered_size(word_at(word, 1))
        share[index] = uniform(word_at(word, 2))


@njit(cache=True, nogil=True, error_model="numpy")
def _move(
    first: NDArray[np.float64],
    last: NDArray[np.float64],
    size: NDArray[np.float64],
    share: NDArray[np.float64],
    level: NDArray[np.float64],
    motion: Motion,
    span_us: int,
    moved: NDArray[np.float64],
) -> None:
    """Voltages at the end of the interval; NaN for a side in doubt or a passage within."""
    for index in range(level.size):
        drift, spread = drift_and_spread(first[index], last[index], span_us, motion)
        ahead, behind = exponents(level[index], drift, spread)
        up, down = behind > CERTAIN, ahead < -CERTAIN
        distance = 1.0 - level[index] if up else 1.0 + level[index]
        wait_us = inverse_gaussian(distance, abs(drift), spread, size[index], share[index])
        way = distance * span_us / wait_us
        end = level[index] + way if up else level[index] - way
        moved[index] = end if (up | down) & (wait_us >= span_us) else np.nan


@njit(cache=True, nogil=True)
def fire(
    chosen: NDArray[np.int32],
    start: Seen,
    end: Seen,
    voltage: NDArray[np.float64],
    motion: Motion,
    faithful: bool,
    frame_key: np.uint64,
    start_us: int,
    span_us: int,
    keys: NDArray[np.int64],
) -> Fired:
    """Move pixels from passage to passage.

    Args:
        chosen: the pixels to move.
        start: the image at the start of the interval.
        end: the image at its end.
        voltage: of each pixel, between the barriers -1 and 1; updated.
        motion: what drives it.
        faithful: whether to keep the published defects.
        frame_key: family of draws of this interval.
        start_us: its start.
        span_us: its length.
        keys: buffer for the events.
    """
    rounding = 0.5 if faithful else 0.0
    count = 0
    for pixel in chosen:
        first, last = start[1][start[0][pixel]], end[1][end[0][pixel]]
        drift, spread = drift_and_spread(first, last, span_us, motion)
        level, elapsed_us = voltage[pixel], 0.0
        word = word_at(frame_key, pixel)
        while True:
            chance = chance_of_on(level, drift, spread, faithful)
            up = chance == 1.0 or uniform(word_at(word, 0)) < chance
            distance = 1.0 - level if up else 1.0 + level
            towards = drift if up else -drift
            wait_us = passage_time(distance, towards, spread, word, faithful)
            if elapsed_us + wait_us >= span_us:
                way = distance * (span_us - elapsed_us) / wait_us
                voltage[pixel] = level + way if up else level - way
                break
            elapsed_us += wait_us
            keys = with_room(keys, count + 1)
            keys[count] = event_key(start_us + int(elapsed_us + rounding), pixel, 1 if up else 0)
            level = 0.0
            word = mixed(word)
            count += 1
    return keys, count
