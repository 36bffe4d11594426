"""First passages of a Brownian motion with drift through a barrier.

The time of the first passage is inverse Gaussian; it is drawn by the two roots of Michael, Schucany
and Haas, "Generating Random Variates Using Transformations with Multiple Roots", 1976.
"""

from __future__ import annotations

import math

import numpy as np

from eqs.kernels import njit
from eqs.simulators.pixel.randomness import normal, uniform, word_at, ziggurat_normal

_SMALLEST_SQUARE = 1e-300
CERTAIN = 40.0  # exponents from which on a chance is nought or one to the last bit
_MOST_ATTEMPTS = 1000


@njit(cache=True)
def chance_of_on(level: float, drift: float, spread: float, faithful: bool) -> float:
    """Probability that +1 is reached before -1 by a motion that stands at `level`.

    Args:
        level: between the barriers.
        drift: per unit of time.
        spread: standard deviation per square root of a unit of time.
        faithful: whether a motion without drift goes either way as likely, wherever it stands.

    Example:
        >>> chance_of_on(0.5, 0.0, 1.0, False), chance_of_on(0.5, 0.0, 1.0, True)
        (0.75, 0.5)
    """
    if drift == 0.0:
        return 0.5 if faithful else 0.5 * (1.0 + level)
    if spread == 0.0:
        return 1.0 if drift > 0 else 0.0
    ahead, behind = exponents(level, drift, spread)
    if behind > CERTAIN:
        return 1.0
    if ahead < -CERTAIN:
        return 0.0
    if drift > 0:
        return np.expm1(-behind) / np.expm1(-(ahead + behind))
    return np.exp(ahead) * np.expm1(behind) / np.expm1(ahead + behind)


# Without a branch, and with infinite numbers in place of errors, so that loops over pixels can
# compute several at a time; so is `inverse_gaussian`.
@njit(cache=True, error_model="numpy")
def exponents(level: float, drift: float, spread: float) -> tuple[float, float]:
    """How certain a motion's drift makes its side: distances to +1 and -1 over its own length.

    From `CERTAIN` on the second says that +1 comes first, below minus that the first says -1.

    Example:
        >>> exponents(0.5, 1.0, 1.0)
        (1.0, 3.0)
    """
    scale = 2.0 * drift / (spread * spread)
    return scale * (1.0 - level), scale * (1.0 + level)


@njit(cache=True)
def passage_time(
    distance: float, towards: float, spread: float, word: np.uint64, faithful: bool
) -> float:
    """Time until a motion first reaches a barrier, given that it does; infinite if it never moves.

    Args:
        distance: to the barrier, at least 0.
        towards: drift towards the barrier, negative away from it.
        spread: standard deviation per square root of a unit of time.
        word: random bits of this draw.
        faithful: whether to keep the published defects without drift and against it.
    """
    if distance <= 0.0:
        return 0.0
    if spread == 0.0:
        return distance / towards if towards > 0 else math.inf
    if towards == 0.0:
        square = max(normal(word_at(word, 1)) ** 2, _SMALLEST_SQUARE)
        return (2.0 if faithful else 1.0) * (distance / spread) ** 2 / square
    if towards < 0.0 and faithful:
        return _misdrawn_passage(distance / abs(towards), (distance / spread) ** 2, word)
    size = ziggurat_normal(word_at(word, 1))
    return inverse_gaussian(distance, abs(towards), spread, size, uniform(word_at(word, 2)))


@njit(cache=True, error_model="numpy")
def inverse_gaussian(
    distance: float, speed: float, spread: float, size: float, share: float
) -> float:
    """The time to a barrier ahead, one of the two roots that a normal number gives.

    Args:
        distance: to the barrier.
        speed: drift towards it.
        spread: standard deviation per square root of a unit of time.
        size: the normal number, of either sign.
        share: uniform number that chooses the root.

    Example:
        >>> inverse_gaussian(1.0, 1.0, 1.0, 1.0, 0.0) * inverse_gaussian(1.0, 1.0, 1.0, 1.0, 0.99)
        1.0
    """
    half = 0.5 * (size * spread) ** 2 / (distance * speed)
    longer = 1.0 + half + math.sqrt(half * (half + 2.0))
    shorter = 1.0 / longer
    return distance / speed * (shorter if share * (1.0 + shorter) <= 1.0 else longer)


@njit(cache=True)
def _misdrawn_passage(mean: float, shape: float, word: np.uint64) -> float:
    """What the same formula gives with a negative mean and a normal number that keeps it real."""
    square = _tail_normal(2.0 * math.sqrt(shape / mean), word) ** 2
    half = max(0.5 * mean / shape * square, 2.0)
    return mean / (half - 1.0 + math.sqrt(half * (half - 2.0)))


@njit(cache=True)
def _tail_normal(bound: float, word: np.uint64) -> float:
    """The size of a normal number beyond a bound (Marsaglia 1964, plain rejection below 1)."""
    for attempt in range(_MOST_ATTEMPTS):
        first = word_at(word, 1 + 2 * attempt)
        if bound < 1.0:
            size = abs(normal(first))
            accepted = size >= bound
        else:
            size = math.sqrt(bound * bound - 2.0 * math.log(1.0 - uniform(first)))
            accepted = uniform(word_at(word, 2 + 2 * attempt)) * size <= bound
        if accepted:
            return size
    return bound
