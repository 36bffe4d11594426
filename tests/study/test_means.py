"""What stands side by side is averaged over the same recordings and seeds, or says so."""

import io

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

from eqs.study import (
    ReportContent,
    answer,
    calibration_table,
    eqs_table,
    order_faults,
    print_eqs,
    print_sanity,
    render_report,
    sanity_table,
    sequence_dots,
    study_table,
    summarise_eqs,
    summarise_study,
)
from eqs.study.layout import accuracy_table, baselines_table, scores_table, summary_table
from eqs.study.notes import few_windows, notes


def printed(eqs, **given):
    out = io.StringIO()
    print_eqs(eqs, Console(file=out, width=200, color_system=None), **given)
    return " ".join(out.getvalue().split())


def page(eqs, **given):
    content = ReportContent(data_name="x", data_is_rendered=False, eqs=eqs, **given)
    return " ".join(render_report(content).split())


@pytest.fixture
def half_anchored(scores):
    """The chance of two of four sequences is not known, those where scores are highest."""
    lacking = scores["sequence"].isin(["test_02", "test_03"])
    return eqs_table(scores.assign(eqs_chance=scores["eqs_chance"].mask(lacking)))


def test_a_scaled_score_compares_means_over_the_same_recordings(half_anchored):
    row = summarise_eqs(half_anchored).set_index("system").loc["esim"]
    own = half_anchored[half_anchored["system"] == "esim"].set_index("sequence")["eqs"]
    assert row["eqs"] == pytest.approx(own.mean())
    assert row["eqs_scaled"] == pytest.approx((own[:2].mean() - 0.21) / (0.93 - 0.21))
    assert (row["sequences"], row["anchored"]) == (4, 2)


def test_a_single_row_with_chance_is_the_scaled_score():
    rows = [
        {"simulator": "esim", "sequence": name, "eqs": score, "eqs_ceiling": ceiling}
        for name, score, ceiling in (("a", 0.55, 0.9), ("b", 0.9, 1.0), ("c", 0.8, 0.99))
    ]
    rows[0]["eqs_chance"] = 0.3
    table = eqs_table(rows)
    scaled = summarise_eqs(table)["eqs_scaled"].item()
    assert scaled == pytest.approx(table["eqs_scaled"].dropna().item())


def test_fewer_anchored_recordings_are_counted_for_the_reader(half_anchored, scores):
    words = "Chance, ceiling and eqs_scaled cover 2 of 4 sequences"
    assert words in printed(half_anchored)
    assert words in page(half_anchored)
    assert "ceiling is 0.930, over 2 of 4 sequences" in answer(half_anchored)[0]
    assert "anchored" in summary_table(half_anchored).header
    for text in (printed(scores), page(scores), *answer(scores)):
        assert "cover" not in text.replace("covers", "")
        assert "anchored" not in text
        assert "of 4 sequences)" not in text
    assert notes(scores) == ()


def test_without_any_chance_the_ceiling_still_stands(scores):
    alone = summarise_eqs(scores.assign(eqs_chance=np.nan)).set_index("system")
    assert alone["eqs_ceiling"].tolist() == pytest.approx([0.93] * 3)
    assert alone["eqs_scaled"].isna().all()
    assert (alone["anchored"] == 0).all()


@pytest.fixture
def one_missing(scores):
    """The first system was not scored on the first, lowest sequence."""
    return scores.iloc[1:]


def test_systems_are_compared_over_the_sequences_that_all_have(one_missing, study):
    means = summarise_eqs(one_missing).set_index("system")
    for name in ("esim", "v2e", "pix2nvs"):
        own = one_missing[(one_missing["system"] == name) & (one_missing["sequence"] != "test_00")]
        assert means.loc[name, "eqs"] == pytest.approx(own["eqs"].mean())
        assert means.loc[name, "sequences"] == 3
        assert means.loc[name, "n_windows"] == 3 * 50
        joined = study_table(study, one_missing).set_index("system").loc[name, "eqs"]
        assert joined.tolist() == pytest.approx([own["eqs"].mean()] * 2)
    assert scores_table(one_missing).rows[-1][1] == f"{means.loc['esim', 'eqs']:.3f}"
    assert "Means cover 3 of 4 sequences" in printed(one_missing)
    assert "over the 3 sequences that all of them have" in answer(one_missing)[0]
    marks = [text.get_text() for text in sequence_dots(one_missing).axes[0].texts]
    assert f"{means.loc['v2e', 'eqs']:.3f}" in marks


def test_systems_without_a_common_sequence_are_not_compared(scores):
    apart = scores[
        (scores["system"] == "esim") & (scores["sequence"] == "test_00")
        | (scores["system"] == "v2e") & (scores["sequence"] == "test_01")
    ]
    means = summarise_eqs(apart)
    assert means["eqs"].isna().all()
    assert (means["sequences"] == 0).all()
    assert answer(apart)[0].startswith("No sequence has been scored for every simulator")
    assert "Means cover 0 of 2 sequences" in printed(apart)


def test_a_reading_that_lacks_a_value_has_no_mean(scores):
    partly = scores.assign(eqs_gate_raw=[0.1, *[np.nan], *[0.99] * 10])
    means = summarise_eqs(partly).set_index("system")["eqs_gate_raw"]
    assert np.isnan(means["esim"])
    assert means["v2e"] == pytest.approx(0.99)


def test_an_unscored_system_takes_nothing_from_the_others(scores):
    unscored = scores.assign(eqs=scores["eqs"].mask(scores["system"] == "v2e"))
    means = summarise_eqs(unscored).set_index("system")
    assert means.loc["esim", "eqs"] == summarise_eqs(scores).set_index("system").loc["esim", "eqs"]
    assert np.isnan(means.loc["v2e", "eqs"])


def test_a_seed_that_lacks_an_accuracy_enters_neither_mean(study):
    lacking = (study["system"] == "esim") & (study["seed"] == 1)
    partly = study_table(study.assign(map_real=study["map_real"].mask(lacking)))
    row = summarise_study(partly).set_index("system").loc["esim"]
    assert (row["map_sim"], row["map_real"]) == pytest.approx((0.31, 0.22))
    assert row["drop_abs"] == pytest.approx(0.09)
    assert row["seeds"] == 1
    rows = accuracy_table(summarise_study(partly)).rows
    assert {row[0] for row in rows} >= {"esim, seeds: 1", "v2e, seeds: 2"}


def test_rivals_of_a_study_are_averaged_over_the_seeds_of_all(study, scores):
    partly = study.assign(baseline_reverse_map=0.1 + 0.1 * study["seed"])
    partly = partly[~((partly["system"] == "v2e") & (partly["seed"] == 1))]
    table = baselines_table(scores, partly)
    (row,) = (row for row in table.rows if row[0] == "reverse_map")
    assert row[1:4] == ("0.100",) * 3


def test_sanity_means_cover_recordings_with_every_corruption():
    rows = [
        {"sequence": name, "corruption": kind, "severity": None, "x": value}
        for name, shift in (("a", 0.0), ("b", 0.0), ("odd", 0.5))
        for kind, value in (("identical", 0.9 - shift), ("chance", 0.5))
        if (name, kind) != ("odd", "chance")
    ]
    table = sanity_table(rows)
    assert table.set_index("corruption")["x"].to_dict() == {"identical": 0.9, "chance": 0.5}
    assert table["sequences"].tolist() == [2, 2]


def test_what_was_not_tested_is_not_called_as_expected():
    rows = [
        {"sequence": "a", "corruption": name, "severity": None, "x": value}
        for name, value in (("identical", 1.0), ("chance", np.nan), ("blank", 0.3))
    ]
    table = sanity_table([*rows, {**rows[0], "corruption": "noise", "severity": 0.1}])
    assert order_faults(table, "x", ("identical", "chance", "blank")) == []
    out = io.StringIO()
    console = Console(file=out, width=200, color_system=None)
    print_sanity(table, "x", ("identical", "chance", "thinned", "blank"), console)
    assert "order as expected; not tested: chance, thinned" in out.getvalue()


def test_a_calibration_s_measure_that_lacks_a_value_has_no_mean():
    table = calibration_table({"before": [{"eqs": 0.2}, {"eqs": np.nan}], "after": [{"eqs": 0.5}]})
    assert np.isnan(table.loc["eqs", "before"])


def test_recordings_of_few_windows_are_named(scores):
    short = scores["sequence"] == "test_01"
    mixed = eqs_table(scores.assign(n_windows=scores["n_windows"].mask(short, 3)))
    words = "Few windows count in test_01 (3): a score of fewer than 20 says little"
    assert words in printed(mixed, fewest_windows=20)
    assert words in page(mixed, fewest_windows=20)
    assert "Few windows" not in printed(mixed)
    assert "Few windows" not in printed(scores, fewest_windows=50)


def test_a_crowd_of_short_recordings_is_counted():
    text = few_windows({f"r{k}": 1 for k in range(12)}, fewest=2)
    assert "r7 (1), 4 others: a score" in text


def test_the_span_is_kept_with_every_score(scores):
    table = eqs_table(scores.assign(start_us=58_936_182_085, stop_us=58_939_132_085))
    assert table["start_us"].tolist() == [58_936_182_085] * 12
    assert isinstance(table["stop_us"].dtype, pd.Int64Dtype)
    assert "start_us" not in summarise_eqs(table)
