"""EQS of one event file against another, with anchors, a map and a curve."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from omegaconf import DictConfig
from rich.console import Console
from rich.table import Table

from eqs.drawing import save_figure, score_curve, score_maps
from eqs.events import EventReader
from eqs.files import write_json
from eqs.metrics import window_starts
from eqs.pipelines.command import explained
from eqs.pipelines.judge import Scoring, find_scoring
from eqs.pipelines.score import score_anchors
from eqs.study import write_table


@explained
def score_files(cfg: DictConfig) -> None:
    """Score `cfg.simulated` against `cfg.real`, print it, and write map and curve to `cfg.out`.

    Raises:
        FileNotFoundError: a file is missing.
        ValueError: there is no judge, or the streams share no whole window or no sensor size.
    """
    scoring = find_scoring(cfg, None)
    headline = scoring.headline.definition
    size = (cfg.height, cfg.width)
    with (
        EventReader(cfg.real, *size) as real,
        EventReader(cfg.simulated, *size) as simulated,
    ):
        starts = window_starts([real, simulated], headline.window_us, cfg.start_us, cfg.stop_us)
        span = int(starts[0]), int(starts[-1]) + headline.window_us
        (found,) = scoring.score(real, [simulated], start_us=span[0], stop_us=span[1])
        known = score_anchors(scoring, real, *span)
        counts = {
            "simulated": len(simulated.window(*span)),
            "real": len(real.window(*span)),
        }
        height, width = real.height, real.width
    scores = {name: score.score for name, score in found.items()}
    result, out = found[scoring.headline.name], Path(cfg.out)
    write_json(
        out / "score.json",
        {
            "simulated": str(cfg.simulated),
            "real": str(cfg.real),
            "eqs": result.score,
            "readings": scores,
            "by_stage": list(result.by_stage),
            "anchors": known,
            "span_us": list(span),
            "windows": result.n_windows,
            "events": counts,
            "definition": headline.hash,
            "weights_sha256": scoring.judge.weights_sha256,
        },
    )
    window_us = headline.window_us
    number = np.arange(len(result.curve))
    curve = {
        "stop_us": span[0] + (number + 1) * window_us,
        "eqs": result.curve,
        "counts": number >= result.warmup,
    }
    write_table(pd.DataFrame(curve), out / "curve.csv")
    panel = {"simulated": result.map}
    drawn = score_maps(None, panel, patch_px=result.patch_px, height=height, width=width)
    save_figure(drawn, out, "map")
    save_figure(
        score_curve(
            result.curve,
            warmup=result.warmup,
            window_us=window_us,
            ceiling=known["ceiling"][scoring.headline.name],
        ),
        out,
        "curve",
    )
    show(scores, known, counts, scoring, Console())


def show(
    scores: dict[str, float],
    known: dict[str, dict[str, float]],
    counts: dict[str, Any],
    scoring: Scoring,
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
        f"judge: {scoring.judge.description} ({scoring.judge.weights_sha256[:12]})"
    )
