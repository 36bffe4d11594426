"""EQS of every simulator on every recording, with anchors beside it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.data import EventSource, Recording
from eqs.events import EventReader, Events
from eqs.events.loaded import LoadedEvents
from eqs.metrics import EventQualityScore, anchors
from eqs.metrics.baselines import FeatureFrechet, baselines
from eqs.metrics.definition import choices
from eqs.metrics.grid import Grid
from eqs.metrics.windows import common_grid
from eqs.names import BASELINE
from eqs.pipelines.following import Following, all_of
from eqs.pipelines.scoring import Scoring

# Anchors and baselines hold events in memory: a long recording lends its first quarter minute.
ANCHOR_US = 15_000_000
READ_AT_ONCE_US = 1_000_000


@dataclass
class Scores:
    """What scoring found, ready for tables and figures.

    Args:
        rows: one per (system, recording), as `eqs.csv` wants them.
        anchors: one per (recording, anchor), a column for each reading.
        maps: by system one headline map per recording.
        patch_px: side of a map's patch in pixels; None where maps are cut evenly.
    """

    rows: list[dict[str, Any]] = field(default_factory=list)
    anchors: list[dict[str, Any]] = field(default_factory=list)
    maps: dict[str, list[NDArray[np.float64]]] = field(default_factory=dict)
    patch_px: int | None = None


def score_recordings(
    scoring: Scoring,
    recordings: Sequence[Recording],
    systems: Mapping[str, EventSource],
    rows: int | None = None,
) -> Scores:
    """Score every system on every recording; the streams must exist already.

    Args:
        scoring: what scores.
        recordings: recordings with frames and real events.
        systems: where each system's events lie, by its name in the tables.
        rows: rows from the top that are looked at; all of them if None.
    """
    scores, follow = Scores(), Following(len(recordings))
    for index, recording in enumerate(recordings):
        other = partner(recording, [*recordings[index + 1 :], *recordings[:index]], rows)
        follow.recording(recording.name)
        with follow, ExitStack() as stack:

            def opened(recording: Recording, path: Path) -> EventReader:
                size = recording.height, recording.width
                return stack.enter_context(EventReader(path, *size, rows=rows))

            real = opened(recording, recording.events_path)
            streams = {name: opened(recording, s.path(recording)) for name, s in systems.items()}
            unrelated = opened(other, other.events_path) if other is not None else None
            try:
                window_us = scoring.headline.definition.window_us
                scene = Scene(
                    name=recording.name,
                    grid=recording_grid(recording, real, window_us),
                    frame_times_us=recording.frame_times_us,
                )
                score_scene(scoring, scene, real, streams, unrelated, scores, follow)
            except ValueError as error:
                raise ValueError(f"{recording.name}: {error}") from error
    return scores


def partner(
    recording: Recording, others: Iterable[Recording], rows: int | None = None
) -> Recording | None:
    """The first other recording of the same sensor size, which lends the chance level.

    Args:
        recording: the recording that is scored.
        others: the others, the preferred one first.
        rows: rows from the top that are looked at; all of them if None.
    """

    def size(each: Recording) -> tuple[int, int]:
        return each.height if rows is None else min(rows, each.height), each.width

    return next((other for other in others if size(other) == size(recording)), None)


@dataclass(frozen=True, kw_only=True)
class Scene:
    """What was recorded once and is scored for several systems.

    Args:
        name: the recording's name.
        grid: the windows that are compared.
        frame_times_us: times of the frames, where there are any.
    """

    name: str
    grid: Grid
    frame_times_us: NDArray[np.int64] | None = None


def score_scene(
    scoring: Scoring,
    scene: Scene,
    real: EventReader | LoadedEvents,
    streams: Mapping[str, EventReader | LoadedEvents],
    other: EventReader | LoadedEvents | None,
    scores: Scores,
    follow: Following | None = None,
) -> None:
    """Add the scores of one recording; `other`, of the same size, lends the chance level."""
    follow = follow or Following()
    start, stop = scene.grid.start_us, scene.grid.stop_us
    candidates = list(streams.values())
    frechet = FeatureFrechet(scoring.headline.definition.maps)
    watch = follow.a_pass("scoring", scoring.headline.definition, start, stop)
    found = scoring.score(
        real, candidates, start_us=start, stop_us=stop, watch=all_of(frechet, watch)
    )
    untrained = untrained_scores(scoring, real, candidates, start, stop, follow)
    frames = scene.frame_times_us
    known = score_anchors(
        scoring,
        real,
        start,
        stop,
        other=other,
        frame_times_us=frames,
        key=scene.name,
        follow=follow,
    )
    shared = shared_columns(scoring, scene, real, known)
    for (name, stream), by_reading, without, distance in zip(
        streams.items(), found, untrained, frechet.values(), strict=True
    ):
        headline = by_reading[scoring.headline.name]
        scores.maps.setdefault(name, []).append(headline.map)
        scores.patch_px = headline.patch_px
        scores.rows.append(
            {
                "system": name,
                **shared,
                "eqs": headline.score,
                **{f"eqs_{reading}": score.score for reading, score in by_reading.items()},
                **score_baselines(scoring, stream, real, start, stop, frames),
                f"{BASELINE}untrained_eqs": without,
                f"{BASELINE}frechet_distance": distance,
                "n_windows": headline.n_windows,
                "n_events_sim": count_events(stream, start, stop),
            }
        )
    scores.anchors += [
        {"sequence": scene.name, "anchor": name, **values} for name, values in known.items()
    ]


def shared_columns(
    scoring: Scoring,
    scene: Scene,
    real: EventReader | LoadedEvents,
    known: Mapping[str, Mapping[str, float]],
) -> dict[str, Any]:
    """The columns of `eqs.csv` that are the same for every system."""
    return {
        "sequence": scene.name,
        "eqs_chance": known.get("chance", {}).get(scoring.headline.name, np.nan),
        "eqs_ceiling": known["ceiling"][scoring.headline.name],
        "start_us": scene.grid.start_us,
        "stop_us": scene.grid.stop_us,
        "n_events_real": count_events(real, scene.grid.start_us, scene.grid.stop_us),
        "definition": scoring.headline.definition.hash,
        "weights_sha256": scoring.judge.weights_sha256,
    }


def count_events(stream: EventReader | LoadedEvents, start_us: int, stop_us: int) -> int:
    """The events of a stretch of time, of which a second at a time is in memory."""
    return sum(
        len(stream.window(at, min(at + READ_AT_ONCE_US, stop_us)))
        for at in range(start_us, stop_us, READ_AT_ONCE_US)
    )


def recording_grid(recording: Recording, real: EventReader, window_us: int) -> Grid:
    """The windows of a recording: those of its real events and a clip as long as its frames.

    It is what two files of that recording are compared over, too: whatever is simulated from
    these frames states their time as its span.

    Raises:
        ValueError: there are no frames, or they share no whole window with the real events.
    """
    times = recording.frame_times_us
    if not len(times):
        raise ValueError(
            "Expected frames that say which time is scored, got none; add images/timestamps.txt"
        )
    silence = Events.empty(real.height, real.width)
    clip = replace(silence, span_us=(int(times[0]), int(times[-1])))
    return common_grid([real, clip], window_us)


def untrained_scores(
    scoring: Scoring,
    real: EventReader | LoadedEvents,
    candidates: Sequence[EventReader | LoadedEvents],
    start_us: int,
    stop_us: int,
    follow: Following,
) -> list[float]:
    """The headline with an untrained network; a centre that it needs is this recording's own."""
    headline = scoring.headline.definition
    chosen = {name: getattr(headline, name) for name in choices()}
    control = scoring.judge.untrained()
    if headline.needs_centre:
        control = control.centred_on([real], [headline.tap], **chosen)
    metric = EventQualityScore(control, chunk_windows=scoring.metric.chunk_windows, **chosen)
    watch = follow.a_pass("untrained network", headline, start_us, stop_us)
    found = metric.score(real, candidates, start_us=start_us, stop_us=stop_us, watch=watch)
    return [by_reading[metric.reading.name].score for by_reading in found]


def score_baselines(
    scoring: Scoring,
    stream: EventReader | LoadedEvents,
    real: EventReader | LoadedEvents,
    start_us: int,
    stop_us: int,
    frame_times_us: NDArray[np.int64] | None,
) -> dict[str, float]:
    """What the cheap rivals say of a stream, by column of `eqs.csv`."""
    stop_us = min(stop_us, start_us + ANCHOR_US)
    found = baselines(
        stream.window(start_us, stop_us),
        real.window(start_us, stop_us),
        scoring.headline.definition,
        start_us=start_us,
        stop_us=stop_us,
        frame_times_us=frame_times_us,
    )
    return {f"{BASELINE}{name}": value for name, value in found.items()}


def first_events(reader: EventReader | LoadedEvents) -> Events:
    """The first quarter minute of a recording's events."""
    return reader.window(reader.start_us, reader.start_us + ANCHOR_US)


def score_anchors(
    scoring: Scoring,
    real: EventReader | LoadedEvents,
    start_us: int,
    stop_us: int,
    *,
    other: EventReader | LoadedEvents | None = None,
    frame_times_us: NDArray[np.int64] | None = None,
    key: str = "",
    follow: Following | None = None,
) -> dict[str, dict[str, float]]:
    """Scores by anchor and reading; those that need `other` or frames are left out without them."""
    stop_us = min(stop_us, start_us + ANCHOR_US)
    events = real.window(start_us, stop_us)
    streams = anchors(
        events,
        other=None if other is None else first_events(other),
        frame_times_us=frame_times_us,
        window_us=scoring.headline.definition.window_us,
        start_us=start_us,
        stop_us=stop_us,
        key=key,
    )
    headline = scoring.headline.definition
    watch = (follow or Following()).a_pass("anchors", headline, start_us, stop_us)
    found = scoring.score(
        events, list(streams.values()), start_us=start_us, stop_us=stop_us, watch=watch
    )
    return {
        name: {reading: score.score for reading, score in by_reading.items()}
        for name, by_reading in zip(streams, found, strict=True)
    }
