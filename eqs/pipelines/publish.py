"""Write what a study found: tables, figures, the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from hydra.utils import instantiate
from omegaconf import DictConfig

from eqs.data import Dataset, EventSource, LabelProtocol, RecordedEvents, Recording
from eqs.drawing import detection_panels, event_rate, events_panels, rate_curves, score_maps
from eqs.metrics import Judge, Reading
from eqs.metrics.grid import fewest_windows
from eqs.pipelines.runs import Run
from eqs.pipelines.score import Scores
from eqs.pipelines.sensors import Sensor, sensor_label, sensor_of
from eqs.pipelines.showcase import RATE_SPAN_US, WINDOW_US, around, choose, detections
from eqs.study import (
    Correlation,
    ReportContent,
    ReportFigure,
    accuracy_bars,
    correlations,
    has_mixing,
    mixing_curve,
    report_figure,
    score_against_accuracy,
    sequence_dots,
    write_correlations,
    write_report,
    write_table,
)
from eqs.study.means import complete_recordings

RATE_BIN_US = 5_000


@dataclass(frozen=True, kw_only=True)
class Findings:
    """Everything a study found, before it is written down.

    Args:
        recordings: the scored recordings.
        judge: what scored them.
        headline: the reading that is the column `eqs`.
        systems: the scored systems by the name used in the tables.
        runs: the finished run of each trained system, by the name used in the tables.
        scores: maps and anchors.
        eqs: one row per (system, recording).
        study: one row per (system, seed), if anything was trained.
    """

    recordings: Sequence[Recording]
    judge: Judge
    headline: Reading
    systems: Mapping[str, EventSource]
    runs: Mapping[str, Run]
    scores: Scores
    eqs: pd.DataFrame
    study: pd.DataFrame | None


def publish(
    cfg: DictConfig, folder: Path, data: Dataset, found: Findings, timings: Mapping[str, float]
) -> None:
    """Write `eqs.csv`, `study.csv`, `anchors.csv`, `correlation.json`, figures and report."""
    write_table(found.eqs, folder / "eqs.csv")
    related: Sequence[Correlation] = ()
    if found.study is not None:
        write_table(found.study, folder / "study.csv")
        related = correlations(found.study)
        write_correlations(related, folder / "correlation.json")
    anchors = anchor_table(found.scores.anchors, f"eqs_{found.headline.name}")
    write_table(anchors, folder / "anchors.csv")
    protocol = instantiate(cfg.protocol)
    sensor, other = sensor_of(data), sensor_label(cfg)
    cards = {"mAP protocol": protocol.card()} if found.runs else {}
    write_report(
        folder,
        ReportContent(
            data_name=cfg.data.name,
            data_is_rendered=sensor is not None,
            sensor=f"sensor {sensor.name}" if sensor is not None and other else "",
            eqs=found.eqs,
            study=found.study,
            correlations=related,
            anchors=anchors,
            figures=draw(folder / "figures", found, protocol, related),
            cards=cards,
            hashes=hashes(found.judge, found.headline, sensor),
            timings=timings,
            unfinished=[name for name in found.systems if cards and name not in found.runs],
            judge=found.judge.description,
            fewest_windows=fewest_windows(found.headline.definition.warmup_windows),
        ),
    )


def anchor_table(rows: Sequence[Mapping[str, Any]], headline: str) -> pd.DataFrame:
    """Mean score of each anchor over the recordings, the highest headline first.

    Convention: the recordings are those that have every anchor, `sequences` in number, so that
    what is compared is averaged over the same of them.
    """
    frame = pd.DataFrame(rows).rename(
        columns=lambda name: name if name in ("sequence", "anchor") else f"eqs_{name}"
    )
    frame = complete_recordings(frame, ["anchor"])
    means = frame.drop(columns="sequence").groupby("anchor", sort=False).mean()
    means.insert(0, "sequences", frame["sequence"].nunique())
    return means.sort_values(headline, ascending=False).reset_index()


def hashes(judge: Judge, headline: Reading, sensor: Sensor | None) -> dict[str, str]:
    """What identifies the judge, the definition and, where there is one, the rendered sensor."""
    named = {
        "EQS definition": headline.definition.hash,
        "judge's weights (sha256)": judge.weights_sha256,
    }
    if headline.centre is not None:
        named["judge's centre (sha256)"] = headline.centre.sha256
    if sensor is not None:
        known = "reference sensor" if sensor.name == "reference_sensor" else f"sensor {sensor.name}"
        named[known] = sensor.hash
    return named


def draw(
    folder: Path,
    found: Findings,
    protocol: LabelProtocol,
    related: Sequence[Correlation],
) -> dict[str, ReportFigure]:
    """Every figure the findings allow, in the order of the report."""
    figures = {}
    if found.study is not None:
        drawn = score_against_accuracy(found.study, found.eqs, related)
        figures["score_against_accuracy"] = report_figure(drawn, folder, "score_against_accuracy")
        figures["accuracy"] = report_figure(accuracy_bars(found.study), folder, "accuracy")
        if has_mixing(found.study):
            figures["mixing"] = report_figure(mixing_curve(found.study), folder, "mixing")
    figures["scores_by_sequence"] = report_figure(
        sequence_dots(found.eqs), folder, "scores_by_sequence"
    )
    return figures | draw_scene(folder, found, protocol)


def draw_scene(folder: Path, found: Findings, protocol: LabelProtocol) -> dict[str, ReportFigure]:
    """The figures that show one scene: events, rates, detections, score maps."""
    shown = choose(found.recordings, protocol)
    place = f"Recording {shown.recording.name}, frame {shown.index}."
    sources = {"real": RecordedEvents(), **found.systems}
    streams = around(shown, sources)
    times, stop = shown.recording.frame_times_us, shown.stop_us
    start = max(int(times[0]), stop - RATE_SPAN_US)
    rates = {name: event_rate(each, start, stop, RATE_BIN_US) for name, each in streams.items()}
    ticks = times[(times >= start) & (times <= stop)] - start
    alike = same_sensor(found.recordings, shown.recording)
    drawn = {
        "events": events_panels(
            shown.frame, streams, start_us=stop - WINDOW_US, stop_us=stop, same="time"
        ),
        "event_rates": rate_curves(rates, bin_us=RATE_BIN_US, frame_times_us=ticks),
        "score_maps": score_maps(
            shown.frame,
            mean_maps(found.scores.maps, alike),
            patch_px=found.scores.patch_px,
            height=shown.recording.height,
            width=shown.recording.width,
        ),
    }
    if found.runs:
        drawn["detections"] = detection_panels(
            shown.events(RecordedEvents()),
            shown.truth(protocol),
            {name: detections(shown, run, protocol) for name, run in found.runs.items()},
            class_names=protocol.class_names,
            frame=shown.frame,
        )
    covered = f"{place} Scores are means over {len(alike)} of {len(found.recordings)} recordings."
    said = {"score_maps": covered}
    return {
        name: report_figure(each, folder, name, said.get(name, place))
        for name, each in drawn.items()
    }


def same_sensor(recordings: Sequence[Recording], shown: Recording) -> list[int]:
    """Places of the recordings whose sensor has the size of the one that is shown."""
    size = shown.height, shown.width
    return [at for at, each in enumerate(recordings) if (each.height, each.width) == size]


def mean_maps(
    maps: Mapping[str, Sequence[np.ndarray]], alike: Sequence[int]
) -> dict[str, np.ndarray]:
    """Mean map of each system over the recordings at these places."""
    return {
        name: np.mean([arrays[place] for place in alike], axis=0) for name, arrays in maps.items()
    }
