"""What is counted: pairs in order, streams above the floor, ways lost, orders that agree."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray


def in_order(scores: Sequence[float]) -> float:
    """Share of the pairs of a chain in which the earlier scores higher; a tie counts half.

    Example:
        >>> in_order([1.0, 0.8, 0.8, 0.9])
        0.58333...
    """
    pairs = list(itertools.combinations(scores, 2))
    won = sum(1.0 if a > b else 0.5 if a == b else 0.0 for a, b in pairs)
    return won / len(pairs)


def shares_in_order(ceiling: float, scores: Mapping[tuple[str, int], float]) -> dict[str, float]:
    """By kind the share of pairs in order, the ceiling before every chain.

    Args:
        ceiling: score of what every chain begins with.
        scores: by kind and step.
    """
    kinds = dict.fromkeys(kind for kind, _ in scores)
    chains = {
        kind: [ceiling, *(scores[key] for key in sorted(key for key in scores if key[0] == kind))]
        for kind in kinds
    }
    return {kind: in_order(chain) for kind, chain in chains.items()}


def floor_share(scores: Sequence[float], chance: float, blank: float) -> float:
    """Share of streams of the same scene that score above both chance and blank."""
    return float(np.mean(np.asarray(scores) > max(chance, blank)))


def way_lost(score: float, ceiling: float, chance: float) -> float:
    """How much of the way from ceiling to chance a stream has gone; NaN where there is none.

    Example:
        >>> way_lost(0.75, ceiling=1.0, chance=0.5)
        0.5
    """
    return (ceiling - score) / (ceiling - chance) if ceiling > chance else float("nan")


def rank_agreement(orders: Sequence[Sequence[float]]) -> float:
    """Mean rank correlation between the scores of the same systems on several recordings.

    Source: Spearman's coefficient, with mean ranks for ties; NaN for fewer than two recordings.
    """
    ranks = [_ranks(order) for order in orders]
    pairs = [np.corrcoef(a, b)[0, 1] for a, b in itertools.combinations(ranks, 2)]
    return float(np.mean(pairs)) if pairs else float("nan")


def _ranks(values: Sequence[float]) -> NDArray[np.float64]:
    exact = np.asarray(values)
    below = (exact[:, None] > exact).sum(axis=1)
    ranks: NDArray[np.float64] = below + 0.5 * (exact[:, None] == exact).sum(axis=1)
    return ranks
