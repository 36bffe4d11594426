"""EQS of one event file against another, with anchors, a map and a curve."""

from __future__ import annotations

import csv
import logging
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from omegaconf import DictConfig
from rich.console import Console
from rich.table import Table

from eqs.events import EventReader
from eqs.extras import DISTRIBUTION
from eqs.files import write_json
from eqs.metrics import StreamScore
from eqs.metrics.grid import Grid
from eqs.metrics.windows import common_grid
from eqs.pipelines.command import explained
from eqs.pipelines.judge import Scoring, find_scoring
from eqs.pipelines.score import score_anchors

log = logging.getLogger(__name__)

UNKNOWN_SPAN = (
    "%s does not say from when to when its camera was watching, so the extent of the real file is "
    "scored; if the frames cover less, a study scores less: set start_us and stop_us to theirs"
)


@explained
def score_files(cfg: DictConfig) -> None:
    """Score `cfg.simulated` against `cfg.real`, print it, and write map and curve to `cfg.out`.

    Raises:
        FileNotFoundError: a file is missing.
        ValueError: there is no judge, or the streams share no whole window or no sensor size.
    """
    scoring = find_scoring(cfg, None)
    headline = scoring.headline.definition
    size = (cfg.height, cfg.width, cfg.rows)
    with (
        EventReader(cfg.real, *size) as real,
        EventReader(cfg.simulated, *size) as simulated,
    ):
        grid = common_grid([real, simulated], headline.window_us, cfg.start_us, cfg.stop_us)
        span = grid.start_us, grid.stop_us
        (found,) = scoring.score(real, [simulated], start_us=span[0], stop_us=span[1])
        known = score_anchors(scoring, real, *span)
        counts = {
            "simulated": len(simulated.window(*span)),
            "real": len(real.window(*span)),
        }
        height, width = real.height, real.width
        watched = simulated.span_us
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
            "share": grid.share,
            "simulated_span_us": None if watched is None else list(watched),
            "sensor": [height, width],
            "events": counts,
            "definition": headline.hash,
            "weights_sha256": scoring.judge.weights_sha256,
        },
    )
    write_curve(out / "curve.csv", result, span[0], headline.window_us)
    console = Console()
    show(scores, known, counts, scoring, console)
    console.print(extent_line(grid, result))
    if watched is None and (cfg.start_us is None or cfg.stop_us is None):
        log.warning(UNKNOWN_SPAN, cfg.simulated)
    ceiling = known["ceiling"][scoring.headline.name]
    if find_spec("matplotlib") is None:
        log.info("no figures: they take pip install '%s[report]'", DISTRIBUTION)
    else:
        draw(out, result, window_us=headline.window_us, ceiling=ceiling, size=(height, width))


def write_curve(path: Path, score: StreamScore, start_us: int, window_us: int) -> None:
    """Write the score of every window and whether it counts; the file appears when complete."""
    partial = path.with_name(path.name + ".partial")
    with partial.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(("stop_us", "eqs", "counts"))
        for number, value in enumerate(score.curve.tolist()):
            stop_us = start_us + (number + 1) * window_us
            rows.writerow((stop_us, value, number >= score.warmup))
    partial.replace(path)


def draw(
    out: Path, score: StreamScore, *, window_us: int, ceiling: float, size: tuple[int, int]
) -> None:
    """Draw where and when the streams differ."""
    from eqs.drawing import save_figure, score_curve, score_maps

    maps = {"simulated": score.map}
    drawn = score_maps(None, maps, patch_px=score.patch_px, height=size[0], width=size[1])
    save_figure(drawn, out, "map")
    curve = score_curve(score.curve, warmup=score.warmup, window_us=window_us, ceiling=ceiling)
    save_figure(curve, out, "curve")


def extent_line(grid: Grid, score: StreamScore) -> str:
    """What was scored, in a line: the span, its windows, its share of the real file."""
    share = "an unknown share" if grid.share is None else f"{100 * grid.share:.1f} %"
    return (
        f"scored from {grid.start_us} us to {grid.stop_us} us, {share} of the real file: "
        f"{grid.count} windows, of which {score.n_windows} count after the warm-up"
    )


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
