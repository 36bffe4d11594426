import base64
import io
from html.parser import HTMLParser

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

from eqs.study import (
    ReportContent,
    ReportFigure,
    answer,
    correlations,
    print_eqs,
    print_study,
    render_report,
    study_table,
    summarise_study,
    write_report,
)
from eqs.study.layout import accuracy_table, scores_table

VOID = {"meta", "img", "br", "link", "hr"}
PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR4nGNgYGBgAAAABQABpfZFQAAAAABJRU5ErkJggg=="
)


class Page(HTMLParser):
    """Collect the text and every tag, and fail on a tag that closes out of turn."""

    def __init__(self, page):
        super().__init__()
        self.open, self.tags, self.words, self.sources = [], [], [], []
        self.feed(page)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.sources += [value for name, value in attributes if name in ("src", "href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())


@pytest.fixture
def content(tmp_path, study, scores):
    path = tmp_path / "rates.png"
    path.write_bytes(PIXEL)
    return ReportContent(
        data_name="dsec_mini",
        data_is_rendered=True,
        eqs=scores,
        study=study,
        correlations=correlations(study),
        anchors=pd.DataFrame({"stream": ["identical", "another scene"], "eqs": [1.0, 0.2]}),
        figures={"rates": ReportFigure("Event rates", "Events per second & pixel.", path)},
        cards={"mAP": {"classes": "car, pedestrian", "boxes": "no filter"}},
        hashes={"reference sensor": "ab12"},
        timings={"train": 900.0, "report": 12.0},
    )


def test_page_is_well_formed_and_needs_nothing_else(tmp_path, content):
    path = write_report(tmp_path / "results", content)
    page = Page(path.read_text(encoding="utf-8"))
    assert "script" not in page.tags
    assert all(source.startswith(("data:image/png;base64,", "#")) for source in page.sources)
    assert str(tmp_path) not in path.read_text(encoding="utf-8")


def test_page_explains_itself_and_marks_the_paper(content):
    text = Page(render_report(content)).text
    for words in (
        "reference sensor",
        "it is not one",
        "Printed in the paper, on DSEC",
        "Ours, on dsec_mini",
        "Higher is better",
        "absolute drop",
        "nothing can be concluded",
        "0.866",
        "37.1",
        "15.2 min",
        "ab12",
        "no filter",
    ):
        assert words in text
    assert "correlates" not in text


def test_page_without_accuracy_or_anything_else(scores):
    page = Page(
        render_report(ReportContent(data_name="recordings", data_is_rendered=False, eqs=scores))
    )
    assert "No detector was trained" in page.text
    assert "reference sensor" not in page.text
    assert "study.csv" not in page.text
    assert "img" not in page.tags


def test_page_names_unfinished_simulators(content, study, scores):
    partial = study[study["system"] != "v2e"]
    page = render_report(
        ReportContent(
            data_name="dsec_mini",
            data_is_rendered=True,
            eqs=scores,
            study=partial,
            correlations=correlations(partial),
            unfinished=("v2e",),
        )
    )
    assert "No finished run yet for: v2e" in Page(page).text


def test_page_escapes_what_it_is_given(scores):
    page = render_report(
        ReportContent(data_name="<script>alert(1)</script>", data_is_rendered=False, eqs=scores)
    )
    assert "<script>" not in page


def test_page_refuses_other_images(tmp_path, scores):
    (tmp_path / "a.bmp").write_bytes(b"")
    for name, message, error in (
        ("a.bmp", "Expected a PNG or SVG figure", ValueError),
        ("b.png", r"Expected the figure b\.png", FileNotFoundError),
    ):
        figures = {"a": ReportFigure("a", "b", tmp_path / name)}
        content = ReportContent(data_name="x", data_is_rendered=False, eqs=scores, figures=figures)
        with pytest.raises(error, match=message):
            render_report(content)


def test_answer_follows_from_the_numbers(study, scores):
    closest, lost, foreseen = answer(scores, study, correlations(study))
    assert "closest simulator to the real stream is esim" in closest
    assert "ahead of v2e in 4 of 4 sequences" in closest
    assert "trained on esim: 21.5 mAP, 10.0 points less" in lost
    assert "trained on pix2nvs: 7.5 mAP" in lost
    assert "trained on real events reaches 25.5 mAP" in lost
    assert "3 of 3 pairs" in foreseen
    assert "nothing can be concluded" in foreseen


def test_answer_counts_pairs_that_disagree(study, scores):
    swapped = study.copy()
    at = swapped["system"] == "esim"
    swapped.loc[at, "map_real"] = 0.01
    foreseen = answer(scores, study_table(swapped, scores))[2]
    assert "1 of 3 pairs" in foreseen


def test_answer_gives_no_ratio_of_next_to_nothing(study, scores):
    weak = study.copy()
    weak[["map_sim", "map_real"]] = [0.02, 0.01]
    assert "% lost" not in answer(scores, study_table(weak, scores))[1]


def test_answer_without_runs_or_scores(scores):
    assert "nothing is known here about accuracy" in answer(scores)[1]
    unscored = scores.assign(eqs=np.nan)
    assert answer(unscored)[0] == "No simulator has been scored yet."


def test_answer_with_one_simulator_asks_for_another(study, scores):
    foreseen = answer(scores, study[study["system"].isin(["real", "esim"])])[2]
    assert "fewer than two simulators" in foreseen


def test_ratios_to_next_to_nothing_are_starred(study):
    weak = study.assign(map_sim=0.05, map_real=0.02)
    rows = accuracy_table(summarise_study(weak)).rows
    assert all(row[4].endswith(" *") and row[5].endswith(" *") for row in rows)
    rows = accuracy_table(summarise_study(study)).rows
    assert not any("*" in cell for row in rows for cell in row)


def test_average_covers_the_sequences_every_simulator_has(scores):
    table = scores_table(scores.iloc[1:])
    assert table.rows[0][1] == "n/a"
    assert table.rows[-1][0] == "average of complete rows"
    own = scores[(scores["system"] == "v2e")]["eqs"].iloc[1:]
    assert table.rows[-1][2] == f"{own.mean():.3f}"


def test_console_shows_what_the_tables_hold(study, scores):
    out = io.StringIO()
    console = Console(file=out, width=200, color_system=None)
    print_study(study, console)
    print_eqs(scores, console)
    text = out.getvalue()
    assert "higher is better" in text
    assert "18.5" in text
    assert f"{scores[scores['system'] == 'v2e']['eqs'].mean():.3f}" in text


@pytest.mark.parametrize("width", [60, 80, 200])
def test_many_systems_are_legible_on_a_narrow_terminal(scores, width):
    names = ("esim", "improved_esim", "dvs_voltmeter", "prophesee", "carla", "gazebo", "icns")
    systems = [scores[scores["system"] == "v2e"].assign(system=name) for name in names]
    many = pd.concat(systems).assign(simulator="v2e")
    out = io.StringIO()
    console = Console(file=out, width=width, color_system=None)
    print_eqs(many, console)
    text = out.getvalue()
    assert "\N{HORIZONTAL ELLIPSIS}" not in text
    assert max(map(len, text.splitlines())) <= width
    cells = [cell.strip() for line in text.splitlines() for cell in line.split("\u2502")]
    assert cells.count(f"{many['eqs'].iloc[0]:.3f}") >= len(names)
