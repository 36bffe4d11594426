"""How a score relates to a target over few systems, and how little few systems can say.

Two rules are built in. Settings of one simulator are relatives, not independent points: they are
permuted and resampled as a family. And below eight simulators, or with a single training seed, a
result is worded as points and numbers from which nothing can be concluded.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from eqs.study.tables import simulated, summarise_study, write_text

SIMULATORS_NEEDED = 8
"""Below this many simulators a relation is reported as points, without a conclusion."""

PERMUTATIONS = 9_999
"""Drawn permutations where listing every one would take longer than `EXACT_PERMUTATIONS`."""

EXACT_PERMUTATIONS = math.factorial(8)
RESAMPLES = 4_999

Vector = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Target:
    """What a score is held against.

    Args:
        name: column of the study's summary, or `log_retention`.
        label: words for an axis or a sentence.
        better: which direction is good for the user, "higher" or "lower".
        note: what a reader has to know before believing a relation with it.
    """

    name: str
    label: str
    better: str
    note: str = ""

    def values(self, systems: pd.DataFrame) -> Vector:
        """The target of every system; NaN where it is not defined."""
        if self.name != "log_retention":
            return systems[self.name].to_numpy(dtype=float)
        retention = systems["retention"].to_numpy(dtype=float)
        return np.log(np.where(retention > 0, retention, np.nan))


TARGETS = (
    Target(name="map_real", label="mAP@[.50:.95] real", better="higher"),
    Target(name="retention", label="retention (real / simulated mAP)", better="higher"),
    Target(name="log_retention", label="log retention", better="higher"),
    Target(name="drop_rel", label="relative drop (1 - real / simulated mAP)", better="lower"),
    Target(
        name="drop_abs",
        label="absolute drop (simulated - real mAP)",
        better="lower",
        note="The absolute drop contains the simulated mAP, so whatever goes with an easy "
        "simulated test set seems to go with the drop: read it last.",
    ),
)


@dataclass(frozen=True, kw_only=True)
class Correlation:
    """One score against one target, with everything needed to judge it.

    Convention: a value that is not defined (fewer than two systems, or no variance in either
    variable) is None.

    Args:
        score: column of the score.
        target: what it is held against.
        points: (system, score, target) of every system that entered.
        left_out: systems whose score or target is not defined.
        families: number of simulators; several settings of one count once.
        seeds: fewest training seeds behind a point.
        pearson: product-moment correlation.
        spearman: rank correlation.
        p_pearson: two-sided permutation p of `pearson`.
        p_spearman: two-sided permutation p of `spearman`.
        p_smallest: the smallest p that so many systems allow `p_pearson` to be.
        p_smallest_rank: likewise for `p_spearman`.
        interval_pearson: 95 % interval, resampling simulators; None below eight.
        interval_spearman: likewise for the rank correlation.
    """

    score: str
    target: Target
    points: tuple[tuple[str, float, float], ...]
    left_out: tuple[str, ...]
    families: int
    seeds: int
    pearson: float | None
    spearman: float | None
    p_pearson: float | None
    p_spearman: float | None
    p_smallest: float | None
    p_smallest_rank: float | None
    interval_pearson: tuple[float, float] | None
    interval_spearman: tuple[float, float] | None

    @property
    def n(self) -> int:
        """Number of systems that entered."""
        return len(self.points)

    @property
    def concludes(self) -> bool:
        """Whether there are enough simulators and seeds to draw a conclusion at all."""
        return self.families >= SIMULATORS_NEEDED and self.seeds >= 2 and self.pearson is not None

    @property
    def correlates(self) -> bool:
        """Whether a conclusion is allowed and the interval leaves out zero."""
        interval = self.interval_pearson
        return self.concludes and interval is not None and interval[0] * interval[1] > 0

    def numbers(self) -> str:
        """Estimate, interval where there is one, n, families, p, seeds and target: never less."""
        interval = self.interval_pearson
        band = f" [{interval[0]:.2f}, {interval[1]:.2f}]" if interval else ""
        return (
            f"r = {_shown(self.pearson)}{band}, rank r = {_shown(self.spearman)}, "
            f"n = {self.n} systems in {self.families} families, "
            f"p_block = {_p(self.p_pearson)} (rank {_p(self.p_spearman)}), "
            f"seeds = {self.seeds}, target = {self.target.label}"
        )

    def sentence(self) -> str:
        """The only form in which this result may be printed."""
        if self.concludes:
            name = self.score.upper() if self.score == "eqs" else self.score
            verdict = f"{name} correlates with" if self.correlates else "No relation is shown with"
            return f"{verdict} {self.target.label}: {self.numbers()}.{self._omitted()}"
        points = "; ".join(f"{name} ({x:.3f}, {y:.3f})" for name, x, y in self.points)
        return (
            f"Points (score, target): {points or 'none'}. {self.numbers()}. "
            f"The smallest p that n = {self.n} allows is {_p(self.p_smallest)} "
            f"(rank {_p(self.p_smallest_rank)}). {self._reservation()}: "
            f"nothing can be concluded from this.{self._omitted()}"
        )

    def _reservation(self) -> str:
        reasons = []
        if self.families < SIMULATORS_NEEDED:
            reasons.append(f"fewer than {SIMULATORS_NEEDED} simulators")
        if self.seeds < 2:
            reasons.append("a single training seed")
        if self.pearson is None:
            reasons.append("no variation in the score or in the target")
        words = " and ".join(reasons)
        return words[:1].upper() + words[1:]

    def _omitted(self) -> str:
        return f" Left out for want of a value: {', '.join(self.left_out)}." * bool(self.left_out)

    def as_dict(self) -> dict[str, Any]:
        """Every number and the sentence, ready for JSON."""
        return {**asdict(self), "n": self.n, "concludes": self.concludes} | {
            "sentence": self.sentence()
        }


def correlations(
    study: pd.DataFrame,
    *,
    scores: Sequence[str] = ("eqs",),
    targets: Iterable[Target] = TARGETS,
    seed: int = 0,
) -> list[Correlation]:
    """Hold each score against each target over the simulated systems of a study.

    The system trained on real events is left out: it is the upper bound, and one far point would
    make the rest look ordered.

    Args:
        study: one row per (system, seed).
        scores: columns to hold against the targets. Each one added makes a high value by chance
            more likely, so the default is the headline alone.
        targets: what to hold them against.
        seed: of drawn permutations and of resampling.
    """
    systems = summarise_study(simulated(study))
    return [
        correlate(systems, score=score, target=target, seed=seed)
        for score in scores
        for target in targets
    ]


def correlate(
    systems: pd.DataFrame, *, score: str = "eqs", target: Target = TARGETS[0], seed: int = 0
) -> Correlation:
    """Hold one score against one target; `systems` has one row per system."""
    x = systems[score].to_numpy(dtype=float)
    y = target.values(systems)
    known = np.isfinite(x) & np.isfinite(y)
    labels = systems["system"].to_numpy()
    families = pd.factorize(systems["simulator"].to_numpy()[known])[0]
    x, y = x[known], y[known]
    count = len(np.unique(families))
    rng = np.random.default_rng([seed, len(x)])
    orders = permutations(families, rng)
    wide = count >= SIMULATORS_NEEDED
    return Correlation(
        score=score,
        target=target,
        points=tuple(zip(map(str, labels[known]), x.tolist(), y.tolist(), strict=True)),
        left_out=tuple(map(str, labels[~known])),
        families=count,
        seeds=int(systems["seeds"][known].min()) if len(x) else 0,
        pearson=pearson(x, y),
        spearman=spearman(x, y),
        p_pearson=permutation_p(x, y, orders),
        p_spearman=permutation_p(stats.rankdata(x), stats.rankdata(y), orders),
        p_smallest=smallest_p(families),
        p_smallest_rank=smallest_p(families, ranks=True),
        interval_pearson=cluster_interval(x, y, families, rng) if wide else None,
        interval_spearman=cluster_interval(x, y, families, rng, ranks=True) if wide else None,
    )


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


def write_correlations(results: Sequence[Correlation], path: Path | str) -> Path:
    """Write `correlation.json`: the rule that words a result, and every result."""
    content = {
        "rule": f"A conclusion needs at least {SIMULATORS_NEEDED} simulators, two training seeds "
        "and an interval without zero; the system trained on real events is never a point.",
        "results": [result.as_dict() for result in results],
    }
    return write_text(json.dumps(content, indent=2, allow_nan=False) + "\n", Path(path))


def _weighted_pearson(weights: NDArray[Any], x: Vector, y: Vector) -> Vector:
    """Correlation under each row of weights (rows, n); NaN where a row has no variance."""
    return _moments(weights, np.broadcast_to(x, weights.shape), np.broadcast_to(y, weights.shape))


def _weighted_spearman(weights: NDArray[Any], x: Vector, y: Vector) -> Vector:
    """Rank correlation of samples that hold each point as often as its weight says."""
    return _moments(weights, _sample_ranks(weights, x), _sample_ranks(weights, y))


def _sample_ranks(weights: NDArray[Any], values: Vector) -> Vector:
    below = (values < values[:, None]) + 0.5 * (values == values[:, None])
    return weights @ below.T


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


def _shown(value: float | None) -> str:
    return "not defined" if value is None else f"{value:.2f}"


def _p(value: float | None) -> str:
    if value is None:
        return "not defined"
    return f"{value:.2f}" if value >= 0.01 else f"{value:.2g}"
