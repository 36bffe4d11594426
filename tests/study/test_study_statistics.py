import itertools
import json

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from eqs.study import TARGETS, correlate, correlations, printed_accuracy, printed_scores
from eqs.study.statistics import (
    PERMUTATIONS,
    cluster_interval,
    pearson,
    permutation_p,
    permutations,
    smallest_p,
    spearman,
    write_correlations,
)


def systems(x, y, simulators=None, seeds=2):
    simulators = simulators if simulators is not None else [f"s{i}" for i in range(len(x))]
    names = [f"{name}-{i}" for i, name in enumerate(simulators)]
    return pd.DataFrame(
        {"system": names, "simulator": simulators, "seeds": seeds, "eqs": x, "map_real": y}
    )


@pytest.fixture
def published():
    accuracy = printed_accuracy()
    table = accuracy.reset_index(names="simulator").assign(seed=0, map50_sim=0.5, map50_real=0.5)
    table["eqs"] = printed_scores().loc["all of DSEC"].to_numpy()
    return table.assign(system=table["simulator"])


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
    result = correlate(systems(flat, varied))
    assert result.pearson is None
    assert "no variation" in result.sentence()


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


@pytest.mark.slow
def test_interval_covers_the_truth():
    rng = np.random.default_rng(7)
    covered = []
    for _ in range(300):
        x = rng.normal(size=12)
        y = 0.8 * x + 0.6 * rng.normal(size=12)
        low, high = cluster_interval(x, y, np.arange(12), rng)
        covered.append(low <= 0.8 <= high)
    assert 0.88 <= np.mean(covered) <= 0.98


def test_published_numbers_change_sign_with_the_meaning_of_drop(published):
    found = {result.target.name: result for result in correlations(published)}
    assert found["map_real"].pearson == pytest.approx(0.997, abs=5e-4)
    assert found["drop_abs"].pearson == pytest.approx(0.60, abs=0.01)
    assert found["drop_rel"].pearson == pytest.approx(-0.88, abs=0.005)
    assert found["log_retention"].pearson == pytest.approx(0.91, abs=0.005)
    assert found["map_real"].p_pearson == pytest.approx(1 / 6)
    assert found["drop_rel"].p_spearman == pytest.approx(1 / 3)


def test_few_simulators_give_points_and_no_conclusion(published):
    for result in correlations(published):
        sentence = result.sentence()
        assert "correlates" not in sentence
        assert "nothing can be concluded" in sentence
        assert "n = 3 systems" in sentence
        assert "smallest p that n = 3 allows is 0.17 (rank 0.33)" in sentence
        assert "esim (0.866" in sentence
        assert result.interval_pearson is None


def test_the_real_reference_is_not_a_point(study):
    result = correlations(study)[0]
    assert [name for name, _, _ in result.points] == ["esim", "v2e", "pix2nvs"]


def many(noise, seeds=2, n=10):
    rng = np.random.default_rng(0)
    x = np.linspace(0.3, 0.8, n)
    return systems(x, 0.3 * x + noise * rng.normal(size=n), seeds=seeds)


def test_enough_simulators_and_seeds_allow_a_conclusion():
    result = correlate(many(0.005))
    assert result.correlates
    assert result.sentence().startswith(
        "EQS correlates with mAP@[.50:.95] real: r = 1.00 [0.99, 1.00]"
    )
    assert "n = 10 systems in 10 families" in result.sentence()
    assert "seeds = 2" in result.sentence()


def test_an_interval_with_zero_shows_no_relation():
    result = correlate(many(1.0))
    assert result.concludes
    assert not result.correlates
    assert result.sentence().startswith("No relation is shown")
    assert "correlates" not in result.sentence()


def test_one_seed_or_few_families_never_conclude():
    assert "single training seed" in correlate(many(0.005, seeds=1)).sentence()
    table = many(0.005)
    table["simulator"] = [f"s{i % 5}" for i in range(10)]
    result = correlate(table)
    assert "fewer than 8 simulators" in result.sentence().lower()
    assert "correlates" not in result.sentence()


def test_systems_without_a_value_are_named():
    result = correlate(systems([0.1, 0.2, np.nan, 0.4], [0.1, 0.3, 0.2, 0.2]))
    assert result.n == 3
    assert result.left_out == ("s2-2",)
    assert "Left out for want of a value: s2-2" in result.sentence()


def test_same_seed_same_numbers():
    assert correlate(many(0.1)) == correlate(many(0.1))


def test_nothing_to_correlate_is_worded_not_raised():
    result = correlate(systems([], []))
    assert result.n == 0
    assert "Points (score, target): none" in result.sentence()


def test_file_holds_every_number_and_the_sentence(tmp_path, published):
    results = correlations(published)
    content = json.loads(write_correlations(results, tmp_path / "correlation.json").read_text())
    assert [entry["target"]["name"] for entry in content["results"]] == [t.name for t in TARGETS]
    first = content["results"][0]
    assert first["sentence"] == results[0].sentence()
    assert first["n"] == 3
    assert first["interval_pearson"] is None
