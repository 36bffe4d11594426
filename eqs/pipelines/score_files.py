"""EQS of one event file against another, with anchors, a map and a curve."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

from omegaconf import DictConfig
from rich.console import Console
from rich.table import Table

from eqs.events import EventReader
from eqs.files import write_json
from eqs.metrics import score_streams
from eqs.metrics.corruptions import anchors
from eqs.pipelines.command import explained
from eqs.pipelines.judge import Judge, find_judge
from eqs.study import save_figure, score_curve, score_maps

# Anchors are made in memory, so they look at no more than the first quarter of a minute.
ANCHOR_US = 15_000_000


@explained
def score_files(cfg: DictConfig) -> None:
    """Score `cfg.simulated` against `cfg.real`, print it, and write map and curve to `cfg.out`.

    Raises:
        FileNotFoundError: a file is missing.
        ValueError: there is no judge, or the streams share no whole window or no sensor size.
    """
    judge = find_judge(cfg, None)
    size = (cfg.height, cfg.width)
    with (
        EventReader(cfg.real, *size) as real,
        EventReader(cfg.simulated, *size) as simulated,
    ):
        span = max(real.start_us, simulated.start_us), min(real.stop_us, simulated.stop_us)
        found = score_streams(
            judge.backbone,
            real,
            [simulated],
            judge.readings,
            start_us=span[0],
            stop_us=span[1],
        )[0]
        known = known_scores(judge, real, *span)
        counts = {
            "simulated": len(simulated.window(*span)),
            "real": len(real.window(*span)),
        }
        height, width = real.height, real.width
    scores = {name: score.score for name, score in found.items()}
    headline, out = found[judge.headline.name], Path(cfg.out)
    write_json(
        out / "score.json",
        {
            "simulated": str(cfg.simulated),
            "real": str(cfg.real),
            "eqs": headline.score,
            "readings": scores,
            "by_stage": list(headline.by_stage),
            "anchors": known,
            "windows": headline.n_windows,
            "events": counts,
            "definition": judge.headline.definition.hash,
            "weights_sha256": judge.weights_sha256,
        },
    )
    write_curve(out / "curve.csv", headline.curve.tolist(), headline.warmup, span[0], judge)
    panel = {"simulated": headline.map}
    drawn = score_maps(None, panel, patch_px=headline.patch_px, height=height, width=width)
    save_figure(drawn, out, "map")
    save_figure(
        score_curve(
            headline.curve,
            warmup=headline.warmup,
            window_us=judge.headline.definition.window_us,
            ceiling=known["ceiling"][judge.headline.name],
        ),
        out,
        "curve",
    )
    show(scores, known, counts, judge, Console())


def known_scores(
    judge: Judge, real: EventReader, start_us: int, stop_us: int
) -> dict[str, dict[str, float]]:
    """Scores of streams that need no simulator, by anchor and reading."""
    stop_us = min(stop_us, start_us + ANCHOR_US)
    events = real.window(start_us, stop_us)
    window_us = judge.headline.definition.window_us
    streams = anchors(events, window_us=window_us, start_us=start_us, stop_us=stop_us)
    found = score_streams(
        judge.backbone,
        events,
        list(streams.values()),
        judge.readings,
        start_us=start_us,
        stop_us=stop_us,
    )
    return {
        name: {reading: score.score for reading, score in by_reading.items()}
        for name, by_reading in zip(streams, found, strict=True)
    }


def write_curve(path: Path, curve: list[float], warmup: int, start_us: int, judge: Judge) -> None:
    """One row per window: its end, its score, and whether it counts."""
    window_us = judge.headline.definition.window_us
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["stop_us", "eqs", "counts"])
        for index, score in enumerate(curve):
            rows.writerow([start_us + (index + 1) * window_us, score, index >= warmup])


def show(
    scores: dict[str, float],
    known: dict[str, dict[str, float]],
    counts: dict[str, Any],
    judge: Judge,
    console: Console,
) -> None:
    """Print every reading beside its anchors, the headline first."""
    table = Table(title="EQS (higher is better)")
    chosen = ("ceiling", "thinned_50", "poisson", "blank")
    table.add_column("reading")
    for name in ("simulated", *chosen):
        table.add_column(name.replace("_", " "), justify="right")
    for reading, score in scores.items():
        values = [score, *(known[name][reading] for name in chosen)]
        table.add_row(reading, *(f"{value:.3f}" for value in values))
    console.print(table)
    console.print(
        f"{counts['simulated']} simulated and {counts['real']} real events; "
        f"judge: {judge.description} ({judge.weights_sha256[:12]})"
    )
