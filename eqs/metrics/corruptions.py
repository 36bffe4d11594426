"""Damaged copies of a real stream, from which a score gets its meaning.

Each function takes events and returns events. Those that draw are keyed by a seed and a name, so
that the same recording is damaged in the same way in every process.
"""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eqs.events import Events
from eqs.kernels import njit


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


def some_flipped(events: Events, share: float, *, seed: int = 0, key: str = "") -> Events:
    """Brighter and darker swapped with probability `share`, event by event."""
    flipped = _generator(seed, "flipped", key).random(len(events)) < share
    return _replace(events, p=np.where(flipped, 1 - events.p, events.p).astype(np.uint8))


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
    return _merged(events, poisson(events, ratio=ratio, seed=seed, key=key))


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


def elsewhere(events: Events, start_us: int, stop_us: int) -> Events:
    """The same recording as another scene, whose texture and noise stay while no edge does.

    Convention: it is mirrored, moved by half the width and half the height, what leaves the sensor
    coming in on the other side, and played from the middle of the stretch on.

    Args:
        events: a recording.
        start_us: start of the stretch.
        stop_us: end of the stretch.
    """
    inside = events.window(start_us, stop_us)
    half = (stop_us - start_us) // 2
    first, second = (
        inside.window(start_us, start_us + half),
        inside.window(start_us + half, stop_us),
    )
    turned = Events.concatenate([second.shifted(-half), first.shifted(stop_us - start_us - half)])
    x = (events.width - 1 - turned.x.astype(np.int64) + events.width // 2) % events.width
    y = (turned.y.astype(np.int64) + events.height // 2) % events.height
    return _replace(turned, x=x.astype(np.uint16), y=y.astype(np.uint16))


def jittered_in_time(events: Events, sigma_us: float, *, seed: int = 0, key: str = "") -> Events:
    """Every time moved by normal noise, and the stream put in order again."""
    noise = _generator(seed, "jitter in time", key).normal(0.0, sigma_us, len(events))
    return _in_order(events, t=events.t + np.rint(noise).astype(np.int64))


def jittered_in_space(events: Events, sigma_px: float, *, seed: int = 0, key: str = "") -> Events:
    """Every event moved by normal noise in both directions; what leaves the sensor is lost."""
    noise = _generator(seed, "jitter in space", key).normal(0.0, sigma_px, (2, len(events)))
    x, y = np.stack([events.x, events.y]) + np.rint(noise).astype(np.int64)
    inside = np.flatnonzero((x >= 0) & (x < events.width) & (y >= 0) & (y < events.height))
    moved = {"x": x[inside].astype(np.uint16), "y": y[inside].astype(np.uint16)}
    return _replace(_select(events, inside), **moved)


def reversed_in_time(events: Events) -> Events:
    """The film played backwards between its first and last event: what darkened now brightens."""
    if not len(events):
        return events
    times = (events.t[0] + events.t[-1] - events.t)[::-1]
    signs = (1 - events.p[::-1]).astype(np.uint8)
    return _replace(events, t=times, x=events.x[::-1], y=events.y[::-1], p=signs)


def with_hot_pixels(
    events: Events, share: float = 0.001, rate_hz: float = 1000.0, *, seed: int = 0, key: str = ""
) -> Events:
    """A share of the pixels, at least one, fire at a constant rate, each with its own phase."""
    if not len(events):
        return events
    generator, pixels = _generator(seed, "hot pixels", key), events.height * events.width
    hot = generator.choice(pixels, max(1, round(share * pixels)), replace=False)
    period_us, (first, last) = 1e6 / rate_hz, (int(events.t[0]), int(events.t[-1]))
    beats = np.arange(max(1, int((last - first) / period_us)))
    times = first + (generator.random(len(hot))[:, None] + beats) * period_us
    pixel = np.repeat(hot, len(beats))
    order = np.argsort(times.ravel(), kind="stable")
    noise = Events.from_arrays(
        t=times.ravel()[order].astype(np.int64),
        x=pixel[order] % events.width,
        y=pixel[order] // events.width,
        p=generator.integers(0, 2, len(pixel)),
        height=events.height,
        width=events.width,
    )
    return _merged(events, noise)


def at_double_threshold(events: Events) -> Events:
    """What pixels would send that fire at every second level.

    A pixel that fires each time its log intensity has moved by C says, event by event, where it
    is in steps of C; one with a threshold of 2 C fires when it is two steps from its last event.
    """
    kept = np.zeros(len(events), np.bool_)
    pixel = events.y.astype(np.int64) * events.width + events.x
    _every_second_level(pixel, events.p, np.zeros(events.height * events.width, np.int8), kept)
    return _select(events, np.flatnonzero(kept))


@njit(cache=True)
def _every_second_level(
    pixel: NDArray[np.int64],
    p: NDArray[np.uint8],
    level: NDArray[np.int8],
    kept: NDArray[np.bool_],
) -> None:
    for i in range(len(pixel)):
        level[pixel[i]] += 1 if p[i] else -1
        if abs(level[pixel[i]]) == 2:
            level[pixel[i]] = 0
            kept[i] = True


def _generator(seed: int, name: str, key: str) -> np.random.Generator:
    return np.random.default_rng([seed, zlib.crc32(name.encode()), zlib.crc32(key.encode())])


def _select(events: Events, index: NDArray[np.intp]) -> Events:
    return _replace(events, **{name: getattr(events, name)[index] for name in "txyp"})


def _replace(events: Events, **fields: NDArray[Any]) -> Events:
    kept = {name: getattr(events, name) for name in "txyp"}
    return Events(**{**kept, **fields}, height=events.height, width=events.width)


def _merged(events: Events, others: Events) -> Events:
    joined = {
        name: np.concatenate([getattr(events, name), getattr(others, name)]) for name in "txyp"
    }
    return _in_order(events, **joined)


def _in_order(events: Events, **fields: NDArray[Any]) -> Events:
    columns = {name: fields.get(name, getattr(events, name)) for name in "txyp"}
    order = np.argsort(columns["t"], kind="stable")
    return _replace(events, **{name: column[order] for name, column in columns.items()})
