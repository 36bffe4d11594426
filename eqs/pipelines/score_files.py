"""EQS of one event file against another, with anchors, a map and a curve."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from omegaconf import DictConfig
from rich.console import Console
from rich.table import Table

from eqs.events import EventReader
from eqs.files import write_json
from eqs.metrics import score_streams
from eqs.pipelines.command import explained
from eqs.pipelines.judge import Judge, find_judge
from eqs.pipelines.score import score_anchors
from eqs.study import save_figure, score_curve, score_maps, write_table


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
        known = score_anchors(judge, real, *span)
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
    window_us = judge.headline.definition.window_us
    number = np.arange(len(headline.curve))
    curve = {
        "stop_us": span[0] + (number + 1) * window_us,
        "eqs": headline.curve,
        "counts": number >= headline.warmup,
    }
    write_table(pd.DataFrame(curve), out / "curve.csv")
    panel = {"simulated": headline.map}
    drawn = score_maps(None, panel, patch_px=headline.patch_px, height=height, width=width)
    save_figure(drawn, out, "map")
    save_figure(
        score_curve(
            headline.curve,
            warmup=headline.warmup,
            window_us=window_us,
            ceiling=known["ceiling"][judge.headline.name],
        ),
        out,
        "curve",
    )
    show(scores, known, counts, judge, Console())


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
