"""How often noise alone carries a voltage over a threshold.

Siegert, "On the First Passage Time Probability Problem", Physical Review 81, 1951.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.special import erfcx

from eqs.kernels import njit

FARTHEST = 7.0  # standard deviations; beyond it an event takes hours
NEAREST = 0.05
_STEP = 0.01


def mean_passage(barrier: float) -> float:
    """Mean time in which noise with a correlation time of 1 first passes a barrier.

    It starts at its mean, `T = sqrt(pi) * integral of exp(z^2) (1 + erf(z))` from 0 to the barrier
    over the square root of two; the barrier counts in its standard deviations.

    Example:
        >>> round(mean_passage(2.0), 2), round(mean_passage(4.0), 0)
        (10.43, 2018.0)
    """
    rise, _ = quad(lambda z: erfcx(-z), 0.0, barrier / math.sqrt(2.0))
    return math.sqrt(math.pi) * rise


def _rates() -> NDArray[np.float64]:
    count = round((FARTHEST - NEAREST) / _STEP) + 1
    barriers = NEAREST + _STEP * np.arange(count)
    return np.array([1.0 / mean_passage(barrier) for barrier in barriers])


RATES = _rates()


@njit(cache=True)
def passage_rate(barrier: float) -> float:
    """Inverse of `mean_passage`, from a table; nearer barriers than 0.05 count as that.

    Example:
        >>> round(1 / passage_rate(2.01), 2) == round(mean_passage(2.01), 2), passage_rate(9.0)
        (True, 0.0)
    """
    if barrier >= FARTHEST:
        return 0.0
    place = (max(barrier, NEAREST) - NEAREST) / _STEP
    index = min(int(place), RATES.size - 2)
    share = place - index
    return float((1.0 - share) * RATES[index] + share * RATES[index + 1])
