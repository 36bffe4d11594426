"""One self-contained HTML page that explains a study to someone who has not read the paper."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined

from eqs.files import write_text
from eqs.names import REFERENCE
from eqs.study.answer import answer
from eqs.study.correlation import SIMULATORS_NEEDED, Correlation
from eqs.study.layout import (
    Table,
    accuracy_table,
    baselines_table,
    frame_table,
    printed_scores_table,
    scores_table,
    summary_table,
)
from eqs.study.notes import notes
from eqs.study.printed import ACCURACY_TABLE, SCORES_TABLE
from eqs.study.tables import (
    RATIO_FLOOR,
    baseline_columns,
    composed,
    summarise_study,
)

MEDIA_TYPES = {".png": "image/png", ".svg": "image/svg+xml"}


class ReportFigure(NamedTuple):
    """A figure of the report: a heading, a caption that needs no other text, an image file."""

    title: str
    caption: str
    path: Path


@dataclass(frozen=True, kw_only=True)
class ReportContent:
    """Everything a report may show; whatever is absent is named as absent.

    Args:
        data_name: the data set's name, as in `results/<data>`.
        data_is_rendered: the "real" stream comes from a reference sensor watching a rendered
            world, and is not a recording.
        sensor: what that sensor is called, where it is another than the reference sensor.
        eqs: one row per (system, sequence).
        study: one row per (system, seed); None where no detector was trained.
        correlations: of the headline score with every target.
        anchors: scores of streams whose answer is known; first column names the stream.
        figures: by name, in order of appearance.
        cards: protocol cards, name to key and value.
        hashes: what identifies the sensor, the score's definition, the weights.
        timings: seconds by phase.
        unfinished: simulators without a finished run.
        judge: what the scoring backbone was trained on, in a sentence.
        fewest_windows: windows below which the score of a recording says little.
    """

    data_name: str
    data_is_rendered: bool
    eqs: pd.DataFrame
    study: pd.DataFrame | None = None
    correlations: Sequence[Correlation] = ()
    anchors: pd.DataFrame | None = None
    figures: Mapping[str, ReportFigure | tuple[str, str, Path]] = field(default_factory=dict)
    cards: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    hashes: Mapping[str, str] = field(default_factory=dict)
    timings: Mapping[str, float] = field(default_factory=dict)
    unfinished: Sequence[str] = ()
    judge: str = ""
    sensor: str = ""
    fewest_windows: int = 2


def write_report(folder: Path | str, content: ReportContent) -> Path:
    """Write `report.html`, complete in itself: no script, no other file, no network."""
    return write_text(render_report(content), Path(folder) / "report.html")


def render_report(content: ReportContent) -> str:
    """The page as text.

    Raises:
        ValueError: a figure is neither PNG nor SVG.
        FileNotFoundError: a figure's file is missing.
    """
    environment = Environment(
        loader=PackageLoader("eqs.study"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    template = environment.get_template("report.html.j2")
    return template.render(
        content=content,
        trained=content.study is not None and len(content.study) > 0,
        mixed=content.study is not None and bool(composed(content.study).any()),
        notes=notes(content.eqs, content.fewest_windows),
        answer=answer(content.eqs, content.study, content.correlations),
        real=content.sensor or ("reference sensor" if content.data_is_rendered else "real sensor"),
        tables=_tables(content),
        figures=[_figure(*entry) for entry in content.figures.values()],
        cards={name: list(card.items()) for name, card in content.cards.items()},
        total_s=sum(content.timings.values()),
        floor=f"{100 * RATIO_FLOOR:.0f}",
        needed=SIMULATORS_NEEDED,
        reference=REFERENCE,
        scores_number=SCORES_TABLE,
        accuracy_number=ACCURACY_TABLE,
    )


def _tables(content: ReportContent) -> dict[str, Table]:
    tables = {
        "scores": scores_table(content.eqs),
        "printed": printed_scores_table(),
        "summary": summary_table(content.eqs),
        "eqs_rows": frame_table(content.eqs),
    }
    if baseline_columns(content.eqs):
        tables["baselines"] = baselines_table(content.eqs, content.study)
    if content.study is not None and len(content.study):
        tables["accuracy"] = accuracy_table(summarise_study(content.study))
        tables["study_rows"] = frame_table(content.study)
    if content.anchors is not None and len(content.anchors):
        tables["anchors"] = frame_table(content.anchors)
    return tables


def _figure(title: str, caption: str, path: Path) -> dict[str, str]:
    path = Path(path)
    if path.suffix not in MEDIA_TYPES:
        raise ValueError(f"Expected a PNG or SVG figure, got {path.name}; save it as either")
    if not path.is_file():
        raise FileNotFoundError(
            f"Expected the figure {path.name} in {path.parent.name}/, found none; draw it first"
        )
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    source = f"data:{MEDIA_TYPES[path.suffix]};base64,{data}"
    return {"title": title, "caption": caption, "source": source, "name": path.stem}
