"""Detectors of several kinds of events in tables, relations, report and their own curve."""

import pandas as pd
import pytest
from rich.console import Console

from eqs.study import (
    ReportContent,
    accuracy_bars,
    answer,
    correlations,
    has_mixing,
    mixing_curve,
    mixing_points,
    print_study,
    render_report,
    score_against_accuracy,
    simulated,
    study_table,
    summarise_study,
)
from eqs.study.layout import accuracy_table

COLUMNS = ("simulator", "trained_on", "real_share", "beside", "before", "map_real")
ROWS = [
    ("esim", "esim", 0.0, "esim", "", 0.15),
    ("v2e", "v2e", 0.0, "v2e", "", 0.12),
    ("real", "real", 1.0, "", "", 0.3),
    ("mix_real10", "real 10 %", 0.1, "", "", 0.08),
    ("mix_esim100_real10", "esim 100 % + real 10 %", 0.1, "esim", "", 0.2),
    ("mix_esim100_real100", "esim 100 % + real 100 %", 1.0, "esim", "", 0.31),
    ("esim_then_mix_real10", "esim then real 10 %", 0.1, "", "esim", 0.18),
    ("mix_esim50", "esim 50 %", 0.0, "esim 50 %", "", 0.1),
]


@pytest.fixture
def mixed() -> pd.DataFrame:
    """Two seeds, the second a hundredth better."""
    return study_table(
        {
            **dict(zip(COLUMNS, row, strict=True)),
            "map_real": row[-1] + 0.01 * seed,
            "seed": seed,
            "map_sim": 0.4,
            "map50_sim": 0.5,
            "map50_real": 0.5,
        }
        for row in ROWS
        for seed in range(2)
    )


def test_only_detectors_of_one_stream_whole_are_under_test(mixed, study) -> None:
    assert set(simulated(mixed)["simulator"]) == {"esim", "v2e"}
    assert set(simulated(study)["simulator"]) == {"esim", "v2e", "pix2nvs"}
    assert study["trained_on"].equals(study["simulator"])


def test_mixes_change_no_relation_no_answer_and_no_bar(study, scores) -> None:
    row = {"system": "mix", "simulator": "mix", "trained_on": "esim 100 % + real 10 %"}
    more = pd.concat([study, study[study["simulator"] == "esim"].assign(**row)])
    plain, beside = correlations(study), correlations(more)
    assert [each.as_dict() for each in plain] == [each.as_dict() for each in beside]
    assert answer(scores, more, beside) == answer(scores, study, plain)
    bars = [accuracy_bars(each).axes[0].patches for each in (study, more)]
    assert len(bars[0]) == len(bars[1])
    marks = [score_against_accuracy(each, scores).axes[0].containers for each in (study, more)]
    assert len(marks[0]) == len(marks[1]) == 3


def test_tables_say_what_was_seen(mixed, study, capsys) -> None:
    print_study(mixed, Console(width=200))
    printed = capsys.readouterr().out
    assert "esim then real 10 %" in printed
    print_study(study, Console(width=200))
    assert "trained" not in capsys.readouterr().out


def test_the_report_marks_them(mixed, study, scores) -> None:
    page = render_report(
        ReportContent(data_name="d", data_is_rendered=True, eqs=scores, study=mixed)
    )
    assert "esim 100 % + real 10 %" in page
    assert "They are no simulators" in page
    first = [row[0].partition(",")[0] for row in accuracy_table(summarise_study(mixed)).rows]
    assert first[:3] == ["esim", "v2e", "real 10 %"]
    assert first[-1] == "real (no simulator)"
    plain = render_report(
        ReportContent(data_name="d", data_is_rendered=True, eqs=scores, study=study)
    )
    assert "They are no simulators" not in plain


def test_lines_are_means_over_seeds_by_what_was_seen_with_the_real_events(mixed) -> None:
    points = mixing_points(mixed).set_index(["line", "share"])
    assert points["map_real"].round(6).to_dict() == {
        ("esim only", 0.0): 0.155,
        ("esim, then real", 0.1): 0.185,
        ("real alone", 0.1): 0.085,
        ("real alone", 1.0): 0.305,
        ("real and esim", 0.1): 0.205,
        ("real and esim", 1.0): 0.315,
    }
    assert (points["seeds"] == 2).all()
    assert points["sd"].round(6).eq(round(0.01 / 2**0.5, 6)).all()
    assert points.index[points["only"]].tolist() == [("esim only", 0.0)]


def test_a_table_that_was_written_and_read_gives_the_same_curve(mixed, tmp_path) -> None:
    mixed.to_csv(tmp_path / "study.csv")  # where an empty text becomes no value
    again = mixing_points(pd.read_csv(tmp_path / "study.csv"))
    pd.testing.assert_frame_equal(again, mixing_points(mixed))


def test_the_curve_has_a_line_for_each_way_and_a_level_for_the_simulator(mixed) -> None:
    drawing = mixing_curve(mixed)
    (axes,) = drawing.axes
    named = {text.get_text() for text in drawing.legends[0].get_texts()}
    assert named == {"esim only", "esim, then real", "real alone", "real and esim"}
    (level,) = (line for line in axes.lines if line.get_linestyle() == "--")
    assert level.get_ydata() == pytest.approx([15.5, 15.5])
    assert [text.get_text() for text in axes.get_xticklabels()] == ["10", "100"]


def test_without_a_mix_there_is_no_curve(mixed, study) -> None:
    assert has_mixing(mixed)
    assert not has_mixing(study)
    assert not has_mixing(mixed[mixed["simulator"].isin(["esim", "v2e", "real", "mix_esim50"])])
