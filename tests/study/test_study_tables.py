import numpy as np
import pandas as pd
import pytest

from eqs.study import (
    drops,
    eqs_table,
    printed_accuracy,
    printed_scores,
    read_table,
    scaled_score,
    simulated,
    study_table,
    summarise_eqs,
    summarise_study,
    write_table,
)

ROW = {
    "simulator": "esim",
    "seed": 0,
    "map_sim": 0.4,
    "map50_sim": 0.6,
    "map_real": 0.1,
    "map50_real": 0.2,
}


def test_drops_closed_form():
    assert drops(0.4, 0.1) == pytest.approx((0.3, 0.75, 0.25))
    assert drops(0.2, 0.3) == pytest.approx((-0.1, -0.5, 1.5))


def test_drops_of_a_detector_that_learnt_nothing_have_no_ratio():
    lost = drops(0.0, 0.0)
    assert lost.drop_abs == 0
    assert np.isnan(lost.drop_rel)
    assert np.isnan(lost.retention)


def test_scaled_score_runs_from_chance_to_ceiling():
    ends = scaled_score(pd.Series([0.2, 0.8, 0.5]), pd.Series([0.2] * 3), pd.Series([0.8] * 3))
    assert ends.tolist() == pytest.approx([0, 1, 0.5])
    assert np.isnan(scaled_score(0.5, 0.5, 0.5))


def test_study_table_completes_a_row():
    table = study_table([ROW])
    row = table.iloc[0]
    assert row["system"] == "esim"
    assert row["drop_abs"] == pytest.approx(0.3)
    assert row["retention"] == pytest.approx(0.25)
    assert np.isnan(row["eqs"])


def test_study_table_joins_mean_scores_by_system(study, scores):
    expected = scores[scores["system"] == "v2e"]["eqs"].mean()
    found = study[study["system"] == "v2e"]
    assert found["eqs"].tolist() == pytest.approx([expected, expected])
    assert (found["eqs_distance"] + found["eqs"]).tolist() == pytest.approx([1, 1])
    assert study[study["system"] == "real"]["eqs"].isna().all()


def test_joining_scores_twice_changes_nothing(study, scores):
    pd.testing.assert_frame_equal(study_table(study, scores), study)


def test_negative_precision_means_no_such_box(study):
    assert study["ap_real_cyclist"].isna().all()


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([{**ROW, "map_real": 14.3}], "Expected map_real as a fraction"),
        ([ROW, ROW], "got system esim, seed 0 more than once"),
        ([{**ROW, "protocol": "/home/me/run"}], "free of machine paths"),
        ([{"simulator": "esim", "seed": 0}], "none for map_sim, map50_sim, map_real"),
    ],
)
def test_study_table_refuses(rows, message):
    with pytest.raises(ValueError, match=message):
        study_table(rows)


def test_two_settings_of_a_simulator_are_two_systems():
    rows = [{**ROW, "system": name} for name in ("esim", "esim-theta0.4")]
    summary = summarise_study(study_table(rows))
    assert summary["system"].tolist() == ["esim", "esim-theta0.4"]
    assert summary["simulator"].tolist() == ["esim", "esim"]


def test_summary_agrees_with_itself(study):
    summary = summarise_study(study).set_index("system")
    assert summary.loc["v2e", "map_sim"] == pytest.approx(0.345)
    assert summary.loc["v2e", "drop_abs"] == pytest.approx(0.345 - 0.185)
    assert summary.loc["v2e", "drop_rel"] == pytest.approx(1 - 0.185 / 0.345)
    assert summary.loc["v2e", "map_sim_sd"] == pytest.approx(0.01 / np.sqrt(2))
    assert (summary["seeds"] == 2).all()


def test_simulated_leaves_the_reference_out(study):
    assert set(simulated(study)["system"]) == {"esim", "v2e", "pix2nvs"}


def test_summary_of_scores_averages_sequences_and_adds_counts(scores):
    row = summarise_eqs(scores).set_index("system").loc["esim"]
    own = scores[scores["system"] == "esim"]
    assert row["eqs"] == pytest.approx(own["eqs"].mean())
    assert row["sequences"] == 4
    assert row["n_events_sim"] == 4 * 52_345
    assert row["eqs_scaled"] == pytest.approx((row["eqs"] - 0.21) / (0.93 - 0.21))


def test_eqs_table_works_without_anchors_and_counts():
    table = eqs_table([{"simulator": "esim", "sequence": "a", "eqs": 0.25}])
    assert table["eqs_distance"].tolist() == [0.75]
    assert table["eqs_scaled"].isna().all()
    assert summarise_eqs(table)["eqs"].tolist() == [0.25]


def test_scores_of_two_definitions_do_not_share_a_table(scores):
    mixed = scores.assign(definition=["aa"] * 6 + ["bb"] * 6)
    with pytest.raises(ValueError, match="scores of one definition, got aa, bb"):
        eqs_table(mixed)


def test_tables_survive_the_disk_exactly(tmp_path, study, scores):
    for name, table in {"study": study, "eqs": scores}.items():
        path = write_table(table, tmp_path / "results" / f"{name}.csv")
        back = read_table(path)
        pd.testing.assert_frame_equal(back, table, check_exact=True, check_dtype=False)
        assert [file.name for file in path.parent.glob("*.partial")] == []


def test_hashes_that_look_like_numbers_stay_text(tmp_path, scores):
    back = read_table(write_table(scores, tmp_path / "eqs.csv"))
    assert set(back["definition"]) == {"12345678"}
    assert set(back["weights_sha256"]) == {"1e10" * 16}


def test_a_failed_write_leaves_the_old_table(tmp_path, study, monkeypatch):
    path = write_table(study, tmp_path / "study.csv")
    before = path.read_bytes()

    def fail(self, target):
        raise OSError("disk full")

    monkeypatch.setattr("pathlib.Path.replace", fail)
    with pytest.raises(OSError, match="disk full"):
        write_table(study.iloc[:1], path)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["study.csv"]


def test_missing_table_says_what_to_run(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"Expected a table study\.csv .* evaluate\.py"):
        read_table(tmp_path / "study.csv")


def test_printed_averages_follow_from_printed_rows():
    table = printed_scores()
    means = table.iloc[:5].mean()
    assert means.tolist() == pytest.approx(table.loc["average"].tolist(), abs=0.0011)
    assert table.loc["all of DSEC"].idxmax() == "esim"


def test_printed_drops():
    table = printed_accuracy()
    assert table["drop_abs"].round(3).tolist() == [0.228, 0.158, 0.117]
    assert table["retention"].round(3).tolist() == [0.385, 0.541, 0.316]
