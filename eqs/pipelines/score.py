"""EQS of every simulator on every recording, with anchors beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.progress import track

from eqs.data import EventSource, Recording
from eqs.events import EventReader
from eqs.metrics import StreamScore, score_streams
from eqs.metrics.corruptions import anchors
from eqs.pipelines.judge import Judge

# Anchors are made in memory, so a long recording lends its first quarter of a minute.
ANCHOR_US = 15_000_000


@dataclass
class Scores:
    """What scoring found, ready for tables and figures.

    Args:
        rows: one per (system, recording), as `eqs.csv` wants them.
        anchors: one per (recording, anchor), a column for each reading.
        maps: by system one headline map per recording.
        patch_px: side of a map's patch in pixels.
    """

    rows: list[dict[str, Any]] = field(default_factory=list)
    anchors: list[dict[str, Any]] = field(default_factory=list)
    maps: dict[str, list[NDArray[np.float64]]] = field(default_factory=dict)
    patch_px: int = 0


def score_recordings(
    judge: Judge,
    recordings: Sequence[Recording],
    systems: Mapping[str, EventSource],
) -> Scores:
    """Score every system on every recording; the streams must exist already.

    Args:
        judge: what scores.
        recordings: recordings with frames and real events.
        systems: where each system's events lie, by its label in the tables.
    """
    scores = Scores()
    for index, recording in enumerate(track(recordings, description="scoring")):
        other = recordings[(index + 1) % len(recordings)]
        score_recording(judge, recording, other, systems, scores)
    return scores


def score_recording(
    judge: Judge,
    recording: Recording,
    other: Recording,
    systems: Mapping[str, EventSource],
    scores: Scores,
) -> None:
    """Add the scores of one recording; `other` lends the chance level unless it is the same."""
    with ExitStack() as stack:
        real = stack.enter_context(reader(recording, recording.events_path))
        streams = [stack.enter_context(reader(recording, s.path(recording))) for s in systems.values()]
        start, stop = scoring_span(recording, real)
        found = score_streams(
            judge.backbone, real, streams, judge.readings, start_us=start, stop_us=stop
        )
        known = score_anchors(judge, recording, other, real, (start, stop))
        n_events_real = len(real.window(start, stop))
        for label, stream, by_reading in zip(systems, streams, found, strict=True):
            headline = by_reading[judge.headline.name]
            scores.maps.setdefault(label, []).append(headline.map)
            scores.patch_px = headline.patch_px
            scores.rows.append(
                {
                    "simulator": systems[label].name,
                    "system": label,
                    "sequence": recording.name,
                    "eqs": headline.score,
                    **columns(by_reading),
                    "eqs_chance": known.get("chance", {}).get(judge.headline.name, np.nan),
                    "eqs_ceiling": known["ceiling"][judge.headline.name],
                    "n_windows": headline.n_windows,
                    "n_events_real": n_events_real,
                    "n_events_sim": len(stream.window(start, stop)),
                    "definition": judge.headline.definition.hash,
                    "weights_sha256": judge.weights_sha256,
                }
            )
    scores.anchors += [
        {"sequence": recording.name, "anchor": name, **values} for name, values in known.items()
    ]


def scoring_span(recording: Recording, real: EventReader) -> tuple[int, int]:
    """Where both frames and events are there: a simulator cannot know what came before a frame."""
    times = recording.frame_times_us
    return max(int(times[0]), real.start_us), min(int(times[-1]), real.stop_us)


def score_anchors(
    judge: Judge, recording: Recording, other: Recording, real: EventReader, span: tuple[int, int]
) -> dict[str, dict[str, float]]:
    """Scores by anchor and reading."""
    start, stop = span[0], min(span[1], span[0] + ANCHOR_US)
    events = real.window(start, stop)
    chance = None
    if other.name != recording.name and (other.height, other.width) == (real.height, real.width):
        with reader(other, other.events_path) as source:
            chance = source.window(source.start_us, source.start_us + stop - start)
    streams = anchors(
        events,
        other=chance,
        frame_times_us=recording.frame_times_us,
        window_us=judge.headline.definition.window_us,
        start_us=start,
        stop_us=stop,
        key=recording.name,
    )
    found = score_streams(
        judge.backbone,
        events,
        list(streams.values()),
        judge.readings,
        start_us=start,
        stop_us=stop,
    )
    return {
        name: {reading: score.score for reading, score in by_reading.items()}
        for name, by_reading in zip(streams, found, strict=True)
    }


def reader(recording: Recording, path: Any) -> EventReader:
    """A reader of one of the recording's streams, at the recording's sensor size."""
    return EventReader(path, height=recording.height, width=recording.width)


def columns(by_reading: Mapping[str, StreamScore]) -> dict[str, float]:
    """The scores as columns `eqs_<tap>_<raw|centred>`."""
    return {f"eqs_{name}": score.score for name, score in by_reading.items()}
