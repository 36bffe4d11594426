"""What two files are to each other: scores, their anchors, the nearest damage, a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from omegaconf import DictConfig

from eqs.events.formats import open_events
from eqs.events.loaded import LoadedEvents
from eqs.events.reader import EventReader
from eqs.metrics import StreamScore
from eqs.metrics.corruptions import elsewhere
from eqs.metrics.grid import Grid
from eqs.metrics.windows import common_grid
from eqs.pair import (
    FAMILIES,
    Diagnosis,
    Nearest,
    PageWindows,
    Profile,
    damaged,
    diagnose,
    event_uri,
    map_uri,
    nearest,
    shown_windows,
)
from eqs.pipelines.following import Following
from eqs.pipelines.score import ANCHOR_US, count_events, score_anchors
from eqs.pipelines.scoring import Scoring

Stream = EventReader | LoadedEvents
NEAREST_US: Final = 2_000_000  # of the recordings, in which damages are tried
ELSEWHERE: Final = "the real recording elsewhere (mirrored, moved, played from its middle on)"


@dataclass(frozen=True, kw_only=True)
class Pair:
    """What two files were found to be to each other.

    Args:
        grid: the windows that were compared.
        scores: by reading.
        anchors: scores by anchor and reading.
        chance: what lent the chance level.
        events: numbers of events in these windows.
        watched_us: the span that the simulated file states.
        size: rows and columns that were looked at.
        nearest: damages of the real stream by how near they score; none if not asked for.
        nearest_score: the headline of the stretch in which they were tried.
        nearest_us: how long that is.
        diagnosis: what else differs, over the first quarter minute.
        windows: pictures for the page.
    """

    grid: Grid
    scores: Mapping[str, StreamScore]
    anchors: Mapping[str, Mapping[str, float]]
    chance: str
    events: Mapping[str, int]
    watched_us: tuple[int, int] | None
    size: tuple[int, int]
    nearest: Sequence[Nearest]
    nearest_score: float
    nearest_us: int
    diagnosis: Diagnosis
    windows: PageWindows


def compare(cfg: DictConfig, scoring: Scoring) -> Pair:
    """Score the files over the windows that a study would cut."""
    size, headline = (cfg.height, cfg.width, cfg.rows), scoring.headline
    window_us = headline.definition.window_us
    with (
        open_events(cfg.real, *size) as real,
        open_events(cfg.simulated, *size) as simulated,
        Following() as follow,
    ):
        grid = common_grid([real, simulated], window_us, cfg.start_us, cfg.stop_us)
        span = grid.start_us, grid.stop_us
        shown = shown_windows(grid.count)
        watch = follow.a_pass("scoring", headline.definition, *span)
        (scores,) = scoring.score(
            real, [simulated], start_us=span[0], stop_us=span[1], watch=watch, keep=shown
        )
        files = {"simulated": simulated, "real": real}
        other, chance = other_scene(cfg, real, span)
        known = score_anchors(scoring, real, *span, other=other, follow=follow)
        near = span[0], min(span[1], span[0] + NEAREST_US)
        tried, found = nearest_damages(cfg.nearest, scoring, real, simulated, near, follow)
        first = span[0], min(span[1], span[0] + ANCHOR_US)
        streams = [each.window(*first) for each in (simulated, real)]
        return Pair(
            grid=grid,
            scores=scores,
            anchors=known,
            chance=chance,
            events={name: count_events(each, *span) for name, each in files.items()},
            watched_us=simulated.span_us,
            size=(real.height, real.width),
            nearest=tried,
            nearest_score=found,
            nearest_us=near[1] - near[0],
            diagnosis=diagnose(*streams, start_us=first[0], stop_us=first[1]),
            windows=page_windows(files, grid, shown, scores[headline.name]),
        )


def other_scene(cfg: DictConfig, real: Stream, span: tuple[int, int]) -> tuple[LoadedEvents, str]:
    """What lends the chance level, and its name: a given file, or the real one elsewhere."""
    if cfg.other is None:
        stop = min(span[1], span[0] + ANCHOR_US)
        made = elsewhere(real.window(span[0], stop), span[0], stop)
        return LoadedEvents(made), ELSEWHERE
    with open_events(cfg.other, cfg.height, cfg.width, cfg.rows) as other:
        if (other.height, other.width) != (real.height, real.width):
            raise ValueError(
                f"Expected another recording of {real.width}x{real.height} pixels, got one of "
                f"{other.width}x{other.height} in {cfg.other}; set other"
            )
        start, stop = other.extent_us or (0, 0)
        return LoadedEvents(other.window(start, min(stop, start + ANCHOR_US))), str(cfg.other)


def nearest_damages(
    wanted: bool,
    scoring: Scoring,
    real: Stream,
    simulated: Stream,
    span: tuple[int, int],
    follow: Following,
) -> tuple[list[Nearest], float]:
    """Damages of the real stream, the nearest first, and the score they are held against.

    Families are scored one after the other, so that no more than a few streams are in memory.
    """
    (start, stop), headline = span, scoring.headline
    events = real.window(start, stop)
    if not (wanted and len(events)):
        return [], float("nan")
    profiles: dict[str, dict[float, Profile]] = {}
    own: list[Profile] = []
    for number, family in enumerate(FAMILIES):
        made = damaged(events, family)
        what = f"damage {number + 1} of {len(FAMILIES)}"
        watch = follow.a_pass(what, headline.definition, start, stop)
        streams = [*made.values()] if own else [*made.values(), simulated.window(start, stop)]
        found = scoring.metric.score(events, streams, start_us=start, stop_us=stop, watch=watch)
        seen = [
            Profile(score[headline.name].by_stage, len(stream) / len(events))
            for score, stream in zip(found, streams, strict=True)
        ]
        own = own or seen[-1:]
        profiles[family.name] = dict(zip(made, seen, strict=False))
    return nearest(own[0], profiles), own[0].score


def page_windows(
    files: Mapping[str, Stream], grid: Grid, shown: Sequence[int], score: StreamScore
) -> PageWindows:
    """Pictures of both streams and the map between them, of the windows that a page shows."""
    height, width = files["real"].height, files["real"].width

    def pictures(name: str) -> list[str]:
        starts = (int(grid.starts_us[number]) for number in shown)
        return [event_uri(files[name].window(at, at + grid.window_us)) for at in starts]

    maps = (np.asarray(score.window_maps[number]) for number in shown)
    return PageWindows(
        numbers=shown,
        simulated=pictures("simulated"),
        real=pictures("real"),
        maps=[map_uri(each, score.patch_px, height, width) for each in maps],
    )
