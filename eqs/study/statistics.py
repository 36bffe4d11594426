"""Correlation over few points in families: permutation p values and bootstrap intervals.

Settings of one simulator are relatives, not independent points: they are permuted and resampled
as a family.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

PERMUTATIONS = 9_999
"""Drawn permutations where listing every one would take longer than `EXACT_PERMUTATIONS`."""

EXACT_PERMUTATIONS = math.factorial(8)
RESAMPLES = 4_999

Vector = NDArray[np.float64]


def pearson(x: Vector, y: Vector) -> float | None:
    """Product-moment correlation; None with fewer than two points or without variance."""
    if not (_varies(x) and _varies(y)):
        return None
    return float(_weighted_pearson(np.ones((1, len(x))), x, y)[0])


def spearman(x: Vector, y: Vector) -> float | None:
    """Rank correlation, ties sharing their mean rank; None as for `pearson`."""
    return pearson(stats.rankdata(x), stats.rankdata(y))


def smallest_p(families: NDArray[np.intp], *, ranks: bool = False) -> float | None:
    """The smallest two-sided p of a permutation test of these systems, whatever the data.

    One of all orders is the observed one. Ranks have a second order as extreme, the reverse,
    wherever all families are of one size. Drawn orders cannot go below one in the number drawn.

    Example:
        >>> [round(smallest_p(np.arange(n)), 3) for n in (3, 4, 5)]
        [0.167, 0.042, 0.008]
        >>> [round(smallest_p(np.arange(n), ranks=True), 3) for n in (3, 4, 5)]
        [0.333, 0.083, 0.017]
    """
    if len(families) < 2:
        return None
    count = _order_count(families)
    if count > EXACT_PERMUTATIONS:
        return 1 / (PERMUTATIONS + 1)
    mirrored = ranks and len(set(np.unique(families, return_counts=True)[1].tolist())) == 1
    return (1 + mirrored) / count


def permutations(families: NDArray[np.intp], rng: np.random.Generator) -> NDArray[np.intp]:
    """Orders that are equally likely if a score says nothing, shape (orders, n).

    Convention: families of one size trade places as blocks, and settings trade places within
    their family; with one setting each that is every order. Few orders are listed in full, many
    are drawn, with the observed order first.
    """
    members = [np.flatnonzero(families == family) for family in np.unique(families)]
    sizes = [len(group) for group in members]
    if _order_count(families) <= EXACT_PERMUTATIONS:
        return _every_order(members)
    orders = np.empty((PERMUTATIONS + 1, len(families)), dtype=np.intp)
    orders[0] = np.arange(len(families))
    by_size = [np.flatnonzero(np.array(sizes) == size) for size in sorted(set(sizes))]
    for order in orders[1:]:
        for alike in by_size:
            for place, source in zip(alike, rng.permutation(alike), strict=True):
                order[members[place]] = rng.permutation(members[source])
    return orders


def permutation_p(x: Vector, y: Vector, orders: NDArray[np.intp]) -> float | None:
    """Share of orders of `y` at least as extreme as the observed one, two-sided.

    Convention: the observed order is among `orders`, so the result is never 0; this is
    (1 + #) / (1 + B) where the others were drawn.
    """
    if not (_varies(x) and _varies(y)):
        return None
    products = np.abs(y[orders] @ (x - x.mean()))
    observed = abs(y @ (x - x.mean()))
    tolerance = 1e-9 * np.sqrt(np.square(x - x.mean()).sum() * np.square(y - y.mean()).sum())
    return float(np.mean(products >= observed - tolerance))


def cluster_interval(
    x: Vector,
    y: Vector,
    families: NDArray[np.intp],
    rng: np.random.Generator,
    *,
    ranks: bool = False,
    level: float = 0.95,
) -> tuple[float, float] | None:
    """Bias-corrected and accelerated bootstrap interval of a correlation, resampling families.

    Source: Efron, "Better bootstrap confidence intervals", JASA 1987; the acceleration comes from
    leaving out one family at a time. None where the correlation itself is.
    """
    estimate = spearman(x, y) if ranks else pearson(x, y)
    count = int(families.max()) + 1 if len(families) else 0
    if estimate is None or count < 3:
        return None
    drawn = rng.multinomial(count, np.full(count, 1 / count), size=RESAMPLES)
    jackknife = np.ones((count, count), dtype=int) - np.eye(count, dtype=int)
    correlation = _weighted_spearman if ranks else _weighted_pearson
    values = correlation(drawn[:, families], x, y)
    values = values[np.isfinite(values)]
    left_out = correlation(jackknife[:, families], x, y)
    left_out = left_out[np.isfinite(left_out)]
    below = (np.sum(values < estimate) + 0.5 * np.sum(values == estimate)) / len(values)
    bias = stats.norm.ppf(np.clip(below, 1 / len(values), 1 - 1 / len(values)))
    deviation = left_out.mean() - left_out
    spread = np.square(deviation).sum() ** 1.5
    acceleration = (deviation**3).sum() / (6 * spread) if spread > 0 else 0.0
    tails = bias + stats.norm.ppf([(1 - level) / 2, (1 + level) / 2])
    quantiles = stats.norm.cdf(bias + tails / (1 - acceleration * tails))
    low, high = np.quantile(values, quantiles)
    return float(low), float(high)


def _weighted_pearson(weights: NDArray[Any], x: Vector, y: Vector) -> Vector:
    """Correlation under each row of weights (rows, n); NaN where a row has no variance."""
    return _moments(weights, np.broadcast_to(x, weights.shape), np.broadcast_to(y, weights.shape))


def _weighted_spearman(weights: NDArray[Any], x: Vector, y: Vector) -> Vector:
    """Rank correlation of samples that hold each point as often as its weight says."""
    return _moments(weights, _sample_ranks(weights, x), _sample_ranks(weights, y))


def _sample_ranks(weights: NDArray[Any], values: Vector) -> Vector:
    below = (values < values[:, None]) + 0.5 * (values == values[:, None])
    ranks: Vector = weights @ below.T
    return ranks


def _moments(weights: NDArray[Any], x: Vector, y: Vector) -> Vector:
    share = weights / weights.sum(axis=1, keepdims=True)
    dx = x - (share * x).sum(axis=1, keepdims=True)
    dy = y - (share * y).sum(axis=1, keepdims=True)
    xx, yy = (share * dx**2).sum(axis=1), (share * dy**2).sum(axis=1)
    scale = np.sqrt(xx * yy)
    flat = scale <= 1e-12 * np.sqrt(np.ptp(x) ** 2 * np.ptp(y) ** 2)
    products = (share * dx * dy).sum(axis=1)
    return np.where(flat, np.nan, np.clip(products / np.where(flat, 1, scale), -1, 1))


def _varies(values: Vector) -> bool:
    if len(values) < 2:
        return False
    return bool(np.ptp(values) > 1e-12 * max(1.0, float(np.abs(values).max())))


def _order_count(families: NDArray[np.intp]) -> int:
    sizes = np.unique(families, return_counts=True)[1].tolist()
    alike = np.unique(sizes, return_counts=True)[1].tolist() if sizes else []
    return math.prod(map(math.factorial, [*sizes, *alike]))


def _every_order(members: list[NDArray[np.intp]]) -> NDArray[np.intp]:
    n = sum(map(len, members))
    orders = []
    for places in itertools.permutations(range(len(members))):
        if any(len(members[a]) != len(members[b]) for a, b in enumerate(places)):
            continue
        inside = [itertools.permutations(members[source].tolist()) for source in places]
        for arranged in itertools.product(*inside):
            order = np.empty(n, dtype=np.intp)
            for place, sources in zip(members, arranged, strict=True):
                order[place] = sources
            orders.append(order)
    return np.array(orders, dtype=np.intp).reshape(len(orders), n)
