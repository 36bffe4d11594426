"""Put the score itself to the test, on real streams that were damaged in known ways."""

from __future__ import annotations

import itertools
import logging
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from omegaconf import DictConfig
from rich.console import Console
from rich.progress import track

from eqs.data import Recording
from eqs.drawing import save_figure
from eqs.events import EventReader, Events
from eqs.metrics import EXPECTED_ORDER, GRADED, singles
from eqs.metrics.grid import fewest_windows
from eqs.pipelines.build import dataset
from eqs.pipelines.judge import require_judge
from eqs.pipelines.score import ANCHOR_US, first_events, partner, recording_grid
from eqs.pipelines.scoring import Scoring, find_scoring
from eqs.study import print_sanity, sanity_figure, sanity_table, write_table
from eqs.study.notes import few_windows

log = logging.getLogger(__name__)
AT_ONCE = 8  # streams of one pass of the judge


def sanity(cfg: DictConfig, results: Path, console: Console) -> None:
    """Score every damaged copy of the test recordings; write `sanity.csv` and its figure.

    Raises:
        ValueError: there is no judge, or a recording lacks events.
    """
    require_judge(cfg)  # before a data set is generated
    data = dataset(cfg)
    scoring = find_scoring(cfg, data)
    everything = data.scored_recordings()
    data.make_events(everything)
    recordings = everything[: cfg.sanity_recordings]
    rest = everything[len(recordings) :]
    rows: list[dict[str, Any]] = []
    for index, recording in enumerate(track(recordings, description="sanity battery")):
        others = [*recordings[index + 1 :], *recordings[:index], *rest]
        other = partner(recording, others, data.crop_rows)
        try:
            rows += damaged_scores(scoring, recording, other, data.crop_rows)
        except ValueError as error:
            raise ValueError(f"{recording.name}: {error}") from error
    windows = {row["sequence"]: row.pop("n_windows") for row in rows}
    table = sanity_table(rows)
    headline = scoring.headline.name
    write_table(table, results / "sanity.csv")
    figure = sanity_figure(table, headline, EXPECTED_ORDER)
    save_figure(figure, results / "figures", "sanity")
    print_sanity(table, headline, EXPECTED_ORDER, console)
    console.print(f"[bold]figure[/bold]: {results / 'figures' / 'sanity.png'}")
    warn(windows, table["sequences"].min(), scoring.headline.definition.warmup_windows)


def warn(windows: Mapping[str, int], covered: int, warmup_windows: int) -> None:
    """Name what the means of the table leave out, and recordings of few windows."""
    if covered < len(windows):
        log.warning(
            "Means cover %d of %d recordings: the others have no partner of their sensor size "
            "to lend another scene",
            covered,
            len(windows),
        )
    if few := few_windows(windows, fewest_windows(warmup_windows)):
        log.warning("%s", few)


def damaged_scores(
    scoring: Scoring, recording: Recording, other: Recording | None, rows: int | None
) -> list[dict[str, Any]]:
    """Scores of every damaged copy of one recording, a column for each reading.

    `other`, of the same size, lends another scene; without it there is none.
    """
    with ExitStack() as stack:

        def opened(each: Recording) -> EventReader:
            reader = EventReader(each.events_path, each.height, each.width, rows=rows)
            return stack.enter_context(reader)

        real = opened(recording)
        grid = recording_grid(recording, real, scoring.headline.definition.window_us)
        start, stop = grid.start_us, min(grid.stop_us, grid.start_us + ANCHOR_US)
        events = real.window(start, stop)
        lent = None if other is None else first_events(opened(other))
    made = singles(
        events,
        other=lent,
        frame_times_us=recording.frame_times_us,
        window_us=scoring.headline.definition.window_us,
        start_us=start,
        stop_us=stop,
        key=recording.name,
    )
    found = []
    for batch in batches(events, made, recording.name):
        streams = [stream for _, stream in batch]
        scores = scoring.score(events, streams, start_us=start, stop_us=stop)
        for (named, _), by_reading in zip(batch, scores, strict=True):
            values = {reading: score.score for reading, score in by_reading.items()}
            counted = by_reading[scoring.headline.name].n_windows
            found.append({"sequence": recording.name, "n_windows": counted, **named, **values})
    return found


def batches(
    events: Events, made: dict[str, Events], key: str
) -> Iterator[list[tuple[dict[str, Any], Events]]]:
    """The streams with what they are called, a few at a time; graded ones are made when needed."""
    everything = itertools.chain(
        ((names(name, None), stream) for name, stream in made.items()),
        ((names(g.family, g.severity), g.apply(events, key=key)) for g in GRADED),
    )
    while batch := list(itertools.islice(everything, AT_ONCE)):
        yield batch


def names(corruption: str, severity: float | None) -> dict[str, Any]:
    """The columns that name a stream."""
    return {"corruption": corruption, "severity": severity}
