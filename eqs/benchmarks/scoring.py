"""Time the score against what it cannot do without: two passes of the judge's first stages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import torch
from rich.console import Console
from rich.table import Table
from torch import Tensor

from eqs.benchmarks.timing import Cost, in_own_process, time_runs
from eqs.events import Events
from eqs.metrics import Definition, Judge, Reading, TappedBackbone, group_chunks, score_streams
from eqs.metrics.windows import chunk_length

JUDGE: Final = "varied"
STAGES: Final = (1, 2, 3)
EVENTS_PER_SECOND: Final = 1_000_000
MOST_IN_MEMORY: Final = 16  # windows of histograms; the ratio is one of times per window


@dataclass(frozen=True)
class Job:
    """One line of the table.

    Args:
        what: passes, score or events.
        size: rows and columns of the sensor.
        windows: windows of 50 ms.
    """

    what: str
    size: tuple[int, int]
    windows: int


LINES: Final = {
    "two passes of stages 1-3, from histograms": "passes",
    "score of a pair, from histograms": "score",
    "the same with a network in bfloat16": "half",
    "score of a pair, from events": "events",
}


def measure(job: Job) -> Cost:
    """What one run of `job` costs, once everything is set up."""
    return time_runs(SET_UP[job.what](job), least_runs=1 if job.what == "events" else 3)


def pair(job: Job) -> list[Events]:
    """Two streams of events that are spread evenly, but for a share that crowds into rows."""
    height, width = job.size
    duration_us = job.windows * 50_000
    count = EVENTS_PER_SECOND * duration_us // 1_000_000
    streams = []
    for seed in (0, 1):
        generator = np.random.default_rng(seed)
        streams.append(
            Events.from_arrays(
                t=np.sort(generator.integers(0, duration_us, count)),
                x=generator.integers(0, width, count),
                y=(generator.random(count) ** 2 * height).astype(np.int64),
                p=generator.integers(0, 2, count),
                height=height,
                width=width,
            )
        )
    return streams


def histograms(job: Job) -> list[Tensor]:
    """Both streams' counts, uint8, shape (windows, 20, height, width) each."""
    chunks, _ = group_chunks(pair(job), Definition(), start_us=0, stop_us=job.windows * 50_000)
    both = torch.cat(list(chunks))
    return [both[:, 0].contiguous(), both[:, 1].contiguous()]


def passes(job: Job) -> Callable[[], None]:
    """Each stream through the first stages, as many windows at a time as the score takes."""
    backbone = Judge.load(JUDGE).backbone
    streams = histograms(job)
    length = chunk_length(2, *job.size)

    def run() -> None:
        for stream in streams:
            states = None
            for chunk in stream.split(length):
                with torch.no_grad():
                    _, states = backbone.taps(
                        chunk[:, None].float(), states, stages=STAGES, names=("hidden",)
                    )

    return run


def score(job: Job) -> Callable[[], None]:
    """The headline of histograms, the response to silence included."""
    return _scored(histograms(job))


def half(job: Job) -> Callable[[], None]:
    """The same with a network that computes in bfloat16."""
    return _scored(histograms(job), wrapped=HalfPrecision)


def events(job: Job) -> Callable[[], None]:
    """The same of events, which are counted first."""
    return _scored(pair(job), stop_us=job.windows * 50_000)


class HalfPrecision:
    """A judge's network whose products are computed in bfloat16."""

    def __init__(self, backbone: TappedBackbone) -> None:
        """Wrap the network."""
        self.backbone = backbone

    def taps(self, x: Tensor, states: Any, **asked: Any) -> Any:  # noqa: ANN401
        """The network's maps, in the type they came out in."""
        with torch.autocast(x.device.type, dtype=torch.bfloat16):
            return self.backbone.taps(x, states, **asked)


def rounding(job: Job) -> float:
    """How far bfloat16 moves the score of a pair."""
    streams, reading = histograms(job), Reading(definition=Definition(stages=STAGES))
    backbone = Judge.load(JUDGE).backbone
    scores = []
    for network in (backbone, HalfPrecision(backbone)):
        (found,) = score_streams(network, streams[1], [streams[0]], [reading])
        scores.append(found[reading.name].score)
    return abs(scores[0] - scores[1])


def _scored(
    streams: list[Events] | list[Tensor],
    stop_us: int | None = None,
    wrapped: Callable[[TappedBackbone], TappedBackbone] = lambda backbone: backbone,
) -> Callable[[], None]:
    backbone = wrapped(Judge.load(JUDGE).backbone)
    reading = Reading(definition=Definition(stages=STAGES))
    start_us = None if stop_us is None else 0

    def run() -> None:
        real, simulated = streams
        score_streams(backbone, real, [simulated], [reading], start_us=start_us, stop_us=stop_us)

    return run


SET_UP: Final = {"passes": passes, "score": score, "half": half, "events": events}


def print_table(windows: int, width: int, height: int) -> None:
    """Seconds, memory and the ratio to two passes."""
    table = Table(title=f"A pair of streams of {width}x{height}, RVT-small")
    for column in ("", "windows", "seconds", "ms per window", "peak MiB", "of two passes"):
        table.add_column(column, justify="right" if column else "left")
    base = None
    for shown, what in LINES.items():
        count = windows if what == "events" else min(windows, MOST_IN_MEMORY)
        cost = in_own_process(measure, Job(what, (height, width), count))
        each = cost.seconds / count
        base = base or each
        numbers = (cost.seconds, 1e3 * each, cost.peak_mib, each / base)
        table.add_row(shown, str(count), *(f"{value:.2f}" for value in numbers))
    console = Console(width=max(Console().width, 110))
    console.print(table)
    moved = rounding(Job("half", (height, width), min(windows, MOST_IN_MEMORY)))
    console.print(f"bfloat16 moves the score of this pair by {moved:.1e}")
