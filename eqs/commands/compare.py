"""Compare trainings: accuracy over wall time, and in a table how their settings differ."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from textwrap import shorten

from omegaconf import OmegaConf
from rich.console import Console
from rich.table import Table
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from eqs.drawing import learning_curves, save_figure
from eqs.files import refuse_foreign
from eqs.pipelines.runs import Run

SHOWN = ("model", "recipe", "task")  # parts of a configuration in which trainings differ
MEASURED = "val/map"


def settings(run: Run) -> dict[str, object]:
    """Every setting of a run, by its path."""
    found: dict[str, object] = {}

    def walk(value: object, path: str) -> None:
        if isinstance(value, dict):
            for name, inner in value.items():
                walk(inner, f"{path}.{name}" if path else str(name))
        else:
            found[path] = value

    config = run.config()
    for name in SHOWN:
        walk(OmegaConf.to_container(config[name], resolve=True), name)
    return found


def curve(run: Run) -> list[tuple[float, float]]:
    """Seconds since the first logged step, and accuracy on the validation split."""
    points, start = [], float("inf")
    for folder in sorted({path.parent for path in run.folder.glob("tensorboard/events.*")}):
        record = EventAccumulator(str(folder))
        record.Reload()
        tags = record.Tags()["scalars"]
        start = min([start, *(record.Scalars(tag)[0].wall_time for tag in tags)])
        if MEASURED in tags:
            points += [(point.wall_time, point.value) for point in record.Scalars(MEASURED)]
    return [(at - start, value) for at, value in sorted(points)]


def main(arguments: Sequence[str], shown: str) -> None:
    """Print the table, and draw the curves where a file is named."""
    parser = argparse.ArgumentParser(prog=shown, description=__doc__)
    parser.add_argument("runs", type=Path, nargs="+", help="folders of finished trainings")
    parser.add_argument("--curve", type=Path, help="draw accuracy over time, as .png")
    given = parser.parse_args(arguments)
    if given.curve:
        try:
            for suffix in (".png", ".svg"):
                refuse_foreign(given.curve.with_suffix(suffix))
        except ValueError as error:
            sys.exit(str(error))
    runs = [Run(folder) for folder in given.runs]
    unfinished = [str(run.folder) for run in runs if not run.finished]
    if unfinished:
        sys.exit(f"Expected finished trainings, got none in {', '.join(unfinished)}")
    every = [settings(run) for run in runs]
    first = every[0]
    table = Table("training, and where it differs from the first", "mAP", "AP50", "minutes")
    names: list[str] = []
    for run, own in zip(runs, every, strict=True):
        changed = [
            f"{name}={own.get(name)}"
            for name in sorted(own.keys() | first.keys())
            if own.get(name) != first.get(name)
        ]
        result, real = run.result, run.result.real
        place = f"{len(names) + 1}: {result.system} seed {result.seed}"
        names.append(", ".join([place, *changed]))
        minutes = f"{result.seconds / 60:.1f}"
        table.add_row(names[-1], f"{100 * real.map:.1f}", f"{100 * real.map_50:.1f}", minutes)
    Console().print(table)
    if given.curve:
        labels = [shorten(name, 60, placeholder=" ...") for name in names]
        figure = learning_curves({n: curve(run) for n, run in zip(labels, runs, strict=True)})
        save_figure(figure, given.curve.parent, given.curve.stem)
