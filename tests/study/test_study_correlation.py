import json

import numpy as np
import pandas as pd
import pytest

from eqs.study import (
    TARGETS,
    correlate,
    correlations,
    printed_accuracy,
    printed_scores,
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


def test_no_variation_is_worded():
    result = correlate(systems(np.full(4, 0.3), np.arange(4.0)))
    assert result.pearson is None
    assert "no variation" in result.sentence()


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
