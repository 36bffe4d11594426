import itertools

import numpy as np
import pytest
from scipy import stats

from eqs.study.statistics import (
    PERMUTATIONS,
    cluster_interval,
    pearson,
    permutation_p,
    permutations,
    smallest_p,
    spearman,
)


@pytest.mark.parametrize("ties", [False, True])
def test_estimates_agree_with_scipy(ties):
    rng = np.random.default_rng(1)
    x, y = rng.normal(size=(2, 20))
    if ties:
        x, y = x.round(), y.round()
    assert pearson(x, y) == pytest.approx(stats.pearsonr(x, y).statistic)
    assert spearman(x, y) == pytest.approx(stats.spearmanr(x, y).statistic)


def test_nothing_is_defined_without_variance():
    flat, varied = np.full(4, 0.3), np.arange(4.0)
    assert pearson(flat, varied) is None
    assert spearman(varied, flat) is None
    assert pearson(np.ones(1), np.ones(1)) is None
    assert permutation_p(flat, varied, permutations(np.arange(4), np.random.default_rng(0))) is None


@pytest.mark.parametrize("n", [3, 4, 6])
def test_exact_p_agrees_with_enumeration(n):
    rng = np.random.default_rng(n)
    x, y = rng.normal(size=(2, n))
    observed = abs(np.corrcoef(x, y)[0, 1])
    every = [abs(np.corrcoef(x, order)[0, 1]) for order in itertools.permutations(y)]
    expected = np.mean([value >= observed - 1e-12 for value in every])
    found = permutation_p(x, y, permutations(np.arange(n), rng))
    assert found == pytest.approx(expected)


def test_exact_p_agrees_with_scipy():
    x, y = np.random.default_rng(5).normal(size=(2, 6))
    expected = stats.permutation_test(
        (y,),
        lambda order: abs(np.corrcoef(x, order)[0, 1]),
        permutation_type="pairings",
        alternative="greater",
        n_resamples=np.inf,
        vectorized=False,
    ).pvalue
    found = permutation_p(x, y, permutations(np.arange(6), np.random.default_rng(0)))
    assert found == pytest.approx(expected)


@pytest.mark.parametrize("n", [3, 4, 5])
def test_smallest_p_is_reached_by_perfect_order(n):
    orders = permutations(np.arange(n), np.random.default_rng(0))
    x = np.arange(n, dtype=float)
    assert permutation_p(x, x, orders) == pytest.approx(smallest_p(np.arange(n), ranks=True))
    skewed = x**3
    assert permutation_p(skewed, x + 0.1 * skewed, orders) == pytest.approx(
        smallest_p(np.arange(n))
    )


def test_families_move_as_blocks_of_one_size():
    families = np.array([0, 0, 1, 1, 2])
    orders = permutations(families, np.random.default_rng(0))
    assert len(orders) == len({tuple(order) for order in orders}) == 2 * 2 * 2
    assert (orders[:, 4] == 4).all()
    blocks = families[orders[:, :4]].reshape(-1, 2, 2)
    assert (blocks[:, :, 0] == blocks[:, :, 1]).all()


def test_drawn_orders_hold_the_observed_one_and_keep_families_together():
    families = np.repeat(np.arange(5), 3)
    orders = permutations(families, np.random.default_rng(0))
    assert len(orders) == PERMUTATIONS + 1
    assert orders[0].tolist() == list(range(15))
    assert (np.sort(orders, axis=1) == np.arange(15)).all()
    moved = families[orders].reshape(-1, 5, 3)
    assert (moved == moved[:, :, :1]).all()
    assert smallest_p(families) == pytest.approx(1 / (PERMUTATIONS + 1))


def test_block_permutation_keeps_its_level_where_relatives_fool_the_naive_test():
    rng = np.random.default_rng(0)
    families = np.repeat(np.arange(4), 2)
    orders = permutations(families, rng)
    naive, block = [], []
    for _ in range(400):
        x, y = np.sqrt(0.8) * rng.normal(size=(2, 4))[:, families] + np.sqrt(0.2) * rng.normal(
            size=(2, 8)
        )
        naive.append(stats.pearsonr(x, y).pvalue < 0.05)
        block.append(permutation_p(x, y, orders) < 0.05)
    assert np.mean(block) < 0.08
    assert np.mean(naive) > 0.12


def test_interval_agrees_with_scipy_where_every_family_has_one_system():
    rng = np.random.default_rng(2)
    x = rng.normal(size=30)
    y = 0.8 * x + 0.6 * rng.normal(size=30)
    found = cluster_interval(x, y, np.arange(30), np.random.default_rng(0))
    expected = stats.bootstrap(
        (x, y),
        lambda a, b, axis: stats.pearsonr(a, b, axis=axis).statistic,
        paired=True,
        n_resamples=4_999,
        rng=np.random.default_rng(1),
    ).confidence_interval
    assert found == pytest.approx((expected.low, expected.high), abs=0.03)


def test_interval_ignores_copies_within_a_family():
    rng = np.random.default_rng(4)
    x, y = rng.normal(size=(2, 10))
    single = cluster_interval(x, y, np.arange(10), np.random.default_rng(0))
    copied = cluster_interval(
        np.repeat(x, 5), np.repeat(y, 5), np.repeat(np.arange(10), 5), np.random.default_rng(0)
    )
    assert copied == pytest.approx(single)


def test_rank_interval_resamples_ranks_of_the_sample():
    rng = np.random.default_rng(6)
    x = rng.normal(size=12)
    y = x + rng.normal(size=12)
    low, high = cluster_interval(x, y, np.arange(12), np.random.default_rng(0), ranks=True)
    assert -1 <= low < spearman(x, y) < high <= 1
    monotone = cluster_interval(
        x, np.exp(3 * y), np.arange(12), np.random.default_rng(0), ranks=True
    )
    assert monotone == pytest.approx((low, high))


def test_interval_covers_the_truth():
    rng = np.random.default_rng(7)
    covered = []
    for _ in range(300):
        x = rng.normal(size=12)
        y = 0.8 * x + 0.6 * rng.normal(size=12)
        low, high = cluster_interval(x, y, np.arange(12), rng)
        covered.append(low <= 0.8 <= high)
    assert 0.88 <= np.mean(covered) <= 0.98
