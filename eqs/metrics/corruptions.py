"""Damaged copies of a real stream: the anchors that give a score its meaning.

Each function takes events and returns events. Those that draw are keyed by a seed and a name, so
that the same recording is damaged in the same way in every process.
"""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eqs.events import Events


def blank(events: Events) -> Events:
    """Silence from the same sensor."""
    return Events.empty(events.height, events.width)


def thinned(events: Events, drop: float, *, seed: int = 0, key: str = "") -> Events:
    """Every event dropped with probability `drop`, independently.

    Raises:
        ValueError: the probability is not in [0, 1].
    """
    if not 0 <= drop <= 1:
        raise ValueError(f"Expected drop between 0 and 1, got {drop}")
    keep = _generator(seed, "thinned", key).random(len(events)) >= drop
    return _select(events, np.flatnonzero(keep))


def polarity_flipped(events: Events) -> Events:
    """Brighter and darker swapped."""
    return _replace(events, p=(1 - events.p).astype(np.uint8))


def shifted_in_space(events: Events, columns: int = 0, rows: int = 0) -> Events:
    """The image moved right and down; what leaves the sensor is lost."""
    x, y = events.x.astype(np.int64) + columns, events.y.astype(np.int64) + rows
    inside = (x >= 0) & (x < events.width) & (y >= 0) & (y < events.height)
    moved = _select(events, np.flatnonzero(inside))
    return _replace(moved, x=x[inside].astype(np.uint16), y=y[inside].astype(np.uint16))


def frame_locked(events: Events, frame_times_us: ArrayLike) -> Events:
    """Every event moved to the time of the nearest frame, ties to the later one.

    Raises:
        ValueError: there is no frame.
    """
    times = np.sort(np.asarray(frame_times_us, dtype=np.int64))
    if not len(times):
        raise ValueError("Expected at least one frame time, got none")
    middles = (times[:-1] + times[1:]) / 2
    return _replace(events, t=times[np.searchsorted(middles, events.t, side="right")])


def shuffled_in_windows(
    events: Events, window_us: int = 50_000, *, start_us: int = 0, seed: int = 0, key: str = ""
) -> Events:
    """The order of events inside every window drawn anew; times, and the rest, stay as sets.

    Convention: windows are half-open and begin at `start_us` plus whole multiples of `window_us`.
    """
    window = (events.t - start_us) // window_us
    draw = _generator(seed, "shuffled", key).random(len(events))
    order = np.lexsort((draw, window))
    return _replace(events, x=events.x[order], y=events.y[order], p=events.p[order])


def poisson(
    events: Events,
    *,
    start_us: int | None = None,
    stop_us: int | None = None,
    ratio: float = 1.0,
    seed: int = 0,
    key: str = "",
) -> Events:
    """Noise at the mean rate of a stream times `ratio`: uniform in time and over the sensor.

    Convention: the share of polarities is that of the stream, and a half where it has no events.

    Args:
        events: stream whose rate counts.
        start_us: start of the noise; by default the first event.
        stop_us: end of the noise; by default just after the last event.
        ratio: noise events per event.
        seed: seed of the draws.
        key: name of the recording.
    """
    first, last = (int(events.t[0]), int(events.t[-1]) + 1) if len(events) else (0, 0)
    start = first if start_us is None else start_us
    stop = last if stop_us is None else stop_us
    generator = _generator(seed, "poisson", key)
    count = int(generator.poisson(ratio * len(events.window(start, stop))))
    share = float(events.p.mean()) if len(events) else 0.5
    return Events.from_arrays(
        t=np.sort(generator.integers(start, max(stop, start + 1), count)),
        x=generator.integers(0, events.width, count),
        y=generator.integers(0, events.height, count),
        p=(generator.random(count) < share).astype(np.uint8),
        height=events.height,
        width=events.width,
    )


def with_noise(events: Events, ratio: float = 0.5, *, seed: int = 0, key: str = "") -> Events:
    """The stream and Poisson noise of `ratio` noise events per event."""
    noise = poisson(events, ratio=ratio, seed=seed, key=key)
    joined = {
        name: np.concatenate([getattr(events, name), getattr(noise, name)]) for name in "txyp"
    }
    order = np.argsort(joined["t"], kind="stable")
    fields = {name: values[order] for name, values in joined.items()}
    return Events(**fields, height=events.height, width=events.width)


def on_clock_of(other: Events, start_us: int, stop_us: int) -> Events:
    """Another recording played from `start_us` on, and again from its start until `stop_us`.

    Raises:
        ValueError: the recording is empty.
    """
    if not len(other):
        raise ValueError("Expected another recording with events, got an empty one")
    first, length = int(other.t[0]), int(other.t[-1]) + 1 - int(other.t[0])
    plays = -(-(stop_us - start_us) // length)
    parts = [other.shifted(start_us - first + index * length) for index in range(plays)]
    return Events.concatenate(parts or [blank(other)]).window(start_us, stop_us)


def anchors(
    real: Events,
    *,
    other: Events | None = None,
    frame_times_us: ArrayLike | None = None,
    window_us: int = 50_000,
    start_us: int | None = None,
    stop_us: int | None = None,
    seed: int = 0,
    key: str = "",
) -> dict[str, Events]:
    """The streams whose scores tell what a score means, by name.

    Convention: `ceiling` is the real stream against its own 10 % thinning, `chance` another real
    recording on the same clock.

    Args:
        real: real stream, with events.
        other: another real recording from the same kind of sensor; without it no `chance`.
        frame_times_us: times of the camera's frames; without them no `frame_locked`.
        window_us: window of the score, for the shuffle.
        start_us: start of the first window; by default the first event.
        stop_us: end of the last window; by default just after the last event.
        seed: seed of all draws.
        key: name of the recording.

    Raises:
        ValueError: the real stream is empty, or the other one is.
    """
    if not len(real):
        raise ValueError("Expected a real stream with events to make anchors of, got an empty one")
    start = int(real.t[0]) if start_us is None else start_us
    stop = int(real.t[-1]) + 1 if stop_us is None else stop_us
    made = {
        "identical": real,
        "ceiling": thinned(real, 0.1, seed=seed, key=key),
        "thinned_50": thinned(real, 0.5, seed=seed, key=key),
        "shifted_1px": shifted_in_space(real, columns=1),
        "shifted_4px": shifted_in_space(real, columns=4),
        "shuffled": shuffled_in_windows(real, window_us, start_us=start, seed=seed, key=key),
        "polarity_flipped": polarity_flipped(real),
        "noise_50": with_noise(real, 0.5, seed=seed, key=key),
        "poisson": poisson(real, start_us=start, stop_us=stop, seed=seed, key=key),
        "blank": blank(real),
    }
    if frame_times_us is not None:
        made["frame_locked"] = frame_locked(real, frame_times_us)
    if other is not None:
        made["chance"] = on_clock_of(other, start, stop)
    return made


def _generator(seed: int, name: str, key: str) -> np.random.Generator:
    return np.random.default_rng([seed, zlib.crc32(name.encode()), zlib.crc32(key.encode())])


def _select(events: Events, index: NDArray[np.intp]) -> Events:
    return _replace(events, **{name: getattr(events, name)[index] for name in "txyp"})


def _replace(events: Events, **fields: NDArray[Any]) -> Events:
    kept = {name: getattr(events, name) for name in "txyp"}
    return Events(**{**kept, **fields}, height=events.height, width=events.width)
