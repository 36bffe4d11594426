"""What the console says of two files: every reading in a table, and what they mean in lines."""

from __future__ import annotations

from typing import Final

from rich.console import Console
from rich.table import Table

from eqs.metrics import StreamScore
from eqs.metrics.grid import Grid
from eqs.pair.nearest import sentence
from eqs.pipelines.pair import Pair
from eqs.pipelines.scoring import Scoring

LEVELS: Final = ("ceiling", "chance", "blank")
COLUMNS: Final = ("ceiling", "thinned_50", "poisson", "chance", "blank")


def show(pair: Pair, scoring: Scoring, console: Console) -> None:
    """Print every reading beside its anchors, the headline first, and what it means."""
    table = Table(title="EQS (higher is better)")
    table.add_column("reading")
    for name in ("simulated", *COLUMNS):
        table.add_column(name.replace("_", " "), justify="right")
    for reading, score in pair.scores.items():
        values = [score.score, *(pair.anchors[name][reading] for name in COLUMNS)]
        table.add_row(reading, *(f"{value:z.3f}" for value in values))
    console.print(table)
    for line in lines(pair, scoring):
        console.print(line, markup=False, highlight=False, soft_wrap=True)


def lines(pair: Pair, scoring: Scoring) -> list[str]:
    """What a person wants to know, a sentence each."""
    headline, result = scoring.headline.name, pair.scores[scoring.headline.name]
    levels = {name: pair.anchors[name][headline] for name in LEVELS}
    said = [
        headline_line(headline, result.score, levels),
        f"chance is {pair.chance}; ceiling is the real one without a tenth of its events; blank is "
        "no event at all",
        extent_line(pair.grid, result),
        rate_line(pair),
        f"judge: {scoring.judge.description} ({scoring.judge.weights_sha256[:12]})",
    ]
    if pair.nearest:
        said.insert(1, sentence(pair.nearest, pair.nearest_score, 1e-6 * pair.nearest_us))
    return said


def headline_line(reading: str, score: float, levels: dict[str, float]) -> str:
    """The score by its name, where it lies, and the levels of this very pair.

    Example:
        >>> headline_line("eqs", 0.25, {"ceiling": 0.9, "chance": 0.3, "blank": 0.0})
        'eqs: 0.250, below chance (ceiling 0.900, chance 0.300, blank 0.000)'
    """
    ceiling, chance = levels["ceiling"], levels["chance"]
    if score < chance:
        where = "below chance"
    elif score > ceiling:
        where = "above the ceiling"
    else:
        part = (score - chance) / (ceiling - chance) if ceiling > chance else 1.0
        where = f"{100 * part:.0f} % of the way from chance to ceiling"
    beside = ", ".join(f"{name} {value:z.3f}" for name, value in levels.items())
    return f"{reading}: {score:z.3f}, {where} ({beside})"


def extent_line(grid: Grid, score: StreamScore) -> str:
    """What was scored, in a line: the span, its windows, its share of the real file."""
    share = "an unknown share" if grid.share is None else f"{100 * grid.share:.1f} %"
    counted_s = 1e-6 * score.n_windows * grid.window_us
    return (
        f"scored from {grid.start_us} us to {grid.stop_us} us, {share} of the real file: "
        f"{grid.count} windows, of which {score.n_windows} count after the warm-up, "
        f"{counted_s:.3g} s"
    )


def rates(pair: Pair) -> dict[str, float | None]:
    """Events per second and per pixel and second of both streams, and their ratio."""
    seconds = 1e-6 * (pair.grid.stop_us - pair.grid.start_us)
    pixels = pair.size[0] * pair.size[1]
    found: dict[str, float | None] = {}
    for name, count in pair.events.items():
        found[f"{name}_per_second"] = count / seconds
        found[f"{name}_per_pixel_and_second"] = count / seconds / pixels
    real = pair.events["real"]
    found["simulated_per_real"] = pair.events["simulated"] / real if real else None
    return found


def rate_line(pair: Pair) -> str:
    """How often both streams fire, for a person."""
    found = rates(pair)
    each = (
        f"{name} {found[f'{name}_per_second']:,.0f} events per second "
        f"({found[f'{name}_per_pixel_and_second']:.3g} per pixel)"
        for name in ("simulated", "real")
    )
    ratio = found["simulated_per_real"]
    said = "no real events" if ratio is None else f"{ratio:.2f} simulated events per real one"
    return f"{', '.join(each)}: {said}"
