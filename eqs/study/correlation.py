"""One score against one target over a study's systems, and the words it may be put in.

Two rules are built in. Settings of one simulator are relatives, not independent points. And below
eight simulators, or with a single training seed, a result is worded as points and numbers from
which nothing can be concluded.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from eqs.files import write_text
from eqs.study.statistics import (
    cluster_interval,
    pearson,
    permutation_p,
    permutations,
    smallest_p,
    spearman,
)
from eqs.study.tables import independent, simulated, summarise_study

SIMULATORS_NEEDED = 8
"""Below this many simulators a relation is reported as points, without a conclusion."""


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

    def values(self, systems: pd.DataFrame) -> NDArray[np.float64]:
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
    make the rest look ordered. So are marked systems, which are no simulators like others.

    Args:
        study: one row per (system, seed).
        scores: columns to hold against the targets. Each one added makes a high value by chance
            more likely, so the default is the headline alone.
        targets: what to hold them against.
        seed: of drawn permutations and of resampling.
    """
    systems = summarise_study(independent(simulated(study)))
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


def write_correlations(results: Sequence[Correlation], path: Path | str) -> Path:
    """Write `correlation.json`: the rule that words a result, and every result."""
    content = {
        "rule": f"A conclusion needs at least {SIMULATORS_NEEDED} simulators, two training seeds "
        "and an interval without zero; the system trained on real events and marked systems are "
        "never points.",
        "results": [result.as_dict() for result in results],
    }
    return write_text(json.dumps(content, indent=2, allow_nan=False) + "\n", Path(path))


def _shown(value: float | None) -> str:
    return "not defined" if value is None else f"{value:.2f}"


def _p(value: float | None) -> str:
    if value is None:
        return "not defined"
    return f"{value:.2f}" if value >= 0.01 else f"{value:.2g}"
