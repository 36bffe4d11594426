"""Baselines that only count: how many events, of which polarity, at which pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from eqs.events import Events


def log_rate_error(simulated: Events, real: Events) -> float:
    """Absolute logarithm of the ratio of event numbers; 0 is best.

    Convention: one event is added to either stream, so that silence has a finite error.

    Source: the rate matching of Stoffregen et al., "Reducing the Sim-to-Real Gap for Event
    Cameras", ECCV 2020, read as an error.

    Example:
        >>> two = Events.from_arrays(t=[0, 9], x=[0, 0], y=[0, 0], p=[1, 0], height=1, width=1)
        >>> round(log_rate_error(two, Events.empty(1, 1)), 3)
        1.099
    """
    return float(abs(np.log((len(simulated) + 1) / (len(real) + 1))))


def polarity_error(simulated: Events, real: Events) -> float:
    """Absolute difference of the shares of brighter events, in [0, 1]; 0 is best.

    Convention: a stream without events has a share of one half.
    """
    shares = [float(each.p.mean()) if len(each) else 0.5 for each in (simulated, real)]
    return abs(shares[0] - shares[1])


def rate_map_correlation(simulated: Events, real: Events) -> float:
    """Spearman correlation of the pixels' event numbers, in [-1, 1]; 1 is best.

    Convention: 0 where a map is flat, because a flat map says nothing.
    """
    first, second = counts_per_pixel(simulated), counts_per_pixel(real)
    if np.ptp(first) == 0 or np.ptp(second) == 0:
        return 0.0
    return float(stats.spearmanr(first, second).statistic)


def counts_per_pixel(events: Events) -> NDArray[np.int64]:
    """Number of events of every pixel, row by row."""
    pixel = events.y.astype(np.int64) * events.width + events.x
    return np.bincount(pixel, minlength=events.height * events.width)
