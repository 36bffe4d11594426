"""How a pixel maps grey levels to the signal that it compares."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

MICROSECONDS = 1e-6


class Seen(NamedTuple):
    """An image as pixels see it: the signal of each grey level that occurs, and who has which."""

    codes: NDArray[Any]
    signal: NDArray[Any]


def log_intensity(levels: NDArray[Any], offset: float) -> NDArray[Any]:
    """Natural log of the intensity, 0..1, above an offset that keeps black finite.

    In the number type of the levels: some programs take the log in float32.

    Example:
        >>> log_intensity(np.array([0.0, 255.0]), offset=1e-3).round(3).tolist()
        [-6.908, 0.001]
    """
    return np.log(offset + levels / 255.0)


def lin_log(levels: NDArray[np.float64], knee_level: float = 20.0) -> NDArray[np.float64]:
    """Natural log of the grey level, and a line to the origin below the knee.

    Rounded to 8 decimals, so that equal steps up and down cancel.

    Example:
        >>> lin_log(np.array([0.0, 10.0, 20.0, 200.0])).round(3).tolist()
        [0.0, 1.498, 2.996, 5.298]
    """
    slope = math.log(knee_level) / knee_level
    logarithm = np.log(np.maximum(levels, knee_level))
    signal: NDArray[np.float64] = np.where(levels <= knee_level, levels * slope, logarithm)
    return np.round(signal, 8)


def relative_light(levels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Light as a share of full light, never below the 7 % that v2e gives to black.

    Example:
        >>> float(relative_light(np.array([255.0]))[0])
        1.0
    """
    return (levels + 20.0) / 275.0


def filter_share(
    levels: NDArray[np.float64], cutoff_hz: float, span_us: int
) -> NDArray[np.float64]:
    """Share of the way to the new signal that a first-order filter goes within an interval.

    Euler's step `min(1, q 2 pi cutoff dt)` of v2e and Prophesee, whose bandwidth grows with the
    light `q`; at frames slower than the filter it goes all the way.

    Args:
        levels: grey levels, 0..255.
        cutoff_hz: bandwidth at full light, 0 for no filter.
        span_us: length of the interval.

    Example:
        >>> filter_share(np.array([0.0, 255.0]), 10.0, 10_000).round(3).tolist()
        [0.046, 0.628]
    """
    if cutoff_hz == 0:
        return np.ones_like(levels)
    turns = 2 * math.pi * cutoff_hz * span_us * MICROSECONDS
    return np.minimum(1.0, relative_light(levels) * turns)
