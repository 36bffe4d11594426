"""Delay between a crossing and its event, and the refractory period after it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from eqs.kernels import njit
from eqs.simulators.pixel.randomness import normal

LONGEST_LATENCY_US = 10_000.0
SEEING = -math.inf


class Delays(NamedTuple):
    """What lies between a crossing and its event, and how long the pixel then fires nothing."""

    latency_us: float
    jitter_us: float
    refractory_us: float


"""The end of the refractory period of a pixel that is in none."""


@njit(cache=True)
def latency(mean_us: float, jitter_us: float, blur_us: float, word: np.uint64) -> float:
    """A normally distributed delay, kept between 0 and 10 ms.

    Args:
        mean_us: its mean.
        jitter_us: one part of its standard deviation.
        blur_us: the other part: noise of the threshold over the slope of the signal.
        word: random bits of this draw.

    Example:
        >>> latency(100.0, 0.0, 0.0, np.uint64(1)), latency(1e9, 0.0, 0.0, np.uint64(1))
        (100.0, 10000.0)
    """
    spread_us = math.sqrt(jitter_us * jitter_us + blur_us * blur_us)
    if spread_us > 0.0:
        mean_us += spread_us * normal(word)
    return min(max(mean_us, 0.0), LONGEST_LATENCY_US)
