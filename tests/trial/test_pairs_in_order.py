"""Counting: pairs, floors, ways and orders, by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from scipy import stats

from eqs.trial import floor_share, in_order, rank_agreement, shares_in_order, way_lost
from eqs.trial.weights import learned, weighted


def test_pairs_are_counted_with_ties_by_half() -> None:
    assert in_order([4, 3, 2, 1]) == 1.0
    assert in_order([1, 2, 3]) == 0.0
    assert in_order([2, 2]) == 0.5
    assert in_order([3, 1, 2]) == pytest.approx(2 / 3)


def test_every_chain_begins_with_the_ceiling() -> None:
    scores = {("noise", 2): 0.5, ("noise", 1): 0.8, ("shift", 1): 0.95}
    assert shares_in_order(0.9, scores) == {"noise": 1.0, "shift": 0.0}


def test_the_floor_is_the_higher_of_chance_and_blank() -> None:
    assert floor_share([0.5, 0.2, 0.1, 0.3], chance=0.1, blank=0.25) == 0.5


def test_ways_are_shares_from_ceiling_to_chance() -> None:
    assert way_lost(0.5, 0.9, 0.1) == pytest.approx(0.5)
    assert math.isnan(way_lost(0.5, 0.1, 0.9))


def test_rank_agreement_is_spearman_s() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 9)).round(1)
    assert rank_agreement([a, b]) == pytest.approx(stats.spearmanr(a, b).statistic)
    assert math.isnan(rank_agreement([a]))


def test_weights_find_the_channel_that_tells() -> None:
    # Channel 0 agrees less and less; channel 1 more and more, and is louder.
    products = torch.tensor([[1.8, 2.0], [1.2, 4.0], [0.4, 8.0]], dtype=torch.float64)
    squares = torch.tensor([[2.0, 10.0]] * 3, dtype=torch.float64)
    channels = [torch.stack([products, squares])]
    even = weighted(channels, [torch.ones(2)])
    assert even[2] > even[1] > even[0]
    (weights,) = learned([(channels, [[0, 1, 2]])])
    assert weights[0] > 10 * weights[1]
    better = weighted(channels, [weights])
    assert better[0] > better[1] > better[2]
