"""Verdicts on a score: the expected order and the falling curves."""

import numpy as np
import pytest

from eqs.study import order_faults, sanity_figure, sanity_table, severity_correlations

EXPECTED = ("identical", "thinned", "chance")


@pytest.fixture
def table():
    rows = []
    for sequence, shift in (("a", 0.0), ("b", 0.1)):
        singles = {"identical": 1.0, "thinned": 0.7, "chance": 0.2, "extra": 0.5}
        for name, value in singles.items():
            good, bad = value - shift, 0.99 if name == "chance" else 0.9
            rows.append(
                {"sequence": sequence, "corruption": name, "severity": None, "x": good, "y": bad}
            )
        for level in range(1, 6):
            row = {"sequence": sequence, "corruption": "noise", "severity": 0.1 * level}
            rows.append({**row, "x": 1 - 0.1 * level - shift, "y": 0.5})
    return sanity_table(rows)


def test_scores_are_means_over_recordings(table):
    values = table[table["severity"].isna()].set_index("corruption")["x"]
    assert values["identical"] == pytest.approx(0.95)
    assert len(table) == 4 + 5


def test_faults_name_the_pairs_in_the_wrong_order(table):
    assert order_faults(table, "x", EXPECTED) == []
    assert order_faults(table, "y", EXPECTED) == ["thinned < chance"]
    assert order_faults(table, "x", ["thinned", "missing", "identical"]) == ["thinned < identical"]


def test_severity_and_score_are_ranked(table):
    assert severity_correlations(table, "x") == {"noise": pytest.approx(-1)}
    assert np.isnan(severity_correlations(table, "y")["noise"])


def test_figure_shows_every_corruption(table):
    drawing = sanity_figure(table, "x", EXPECTED)
    names, curves = drawing.axes
    assert [text.get_text() for text in names.get_yticklabels()] == [*EXPECTED, "extra"]
    assert "noise" in curves.get_legend_handles_labels()[1][0]
