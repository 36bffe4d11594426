"""Streams whose answer is known: anchors beside every score, and the battery that tests a score."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final, NamedTuple

from numpy.typing import ArrayLike

from eqs.events import Events
from eqs.metrics import corruptions as damage

# What a person expects, best first: a score that disagrees reacts to something else. Whether ten
# milliseconds of jitter are worse than half of the events lost, nobody can say beforehand.
EXPECTED_ORDER: Final = (
    "identical",
    "ceiling",
    "thinned_50",
    "frame_locked",
    "chance",
    "blank",
)


class Grade(NamedTuple):
    """One of five levels of a corruption."""

    family: str
    severity: float
    apply: Callable[..., Events]


def _grades(
    family: str, function: Callable[..., Events], argument: str, levels: tuple[float, ...]
) -> tuple[Grade, ...]:
    return tuple(Grade(family, level, partial(function, **{argument: level})) for level in levels)


GRADED: Final = (
    *_grades("events dropped, share", damage.thinned, "drop", (0.1, 0.3, 0.5, 0.7, 0.9)),
    *_grades("noise added, per event", damage.with_noise, "ratio", (0.1, 0.25, 0.5, 1.0, 2.0)),
    *_grades("jitter in space, px", damage.jittered_in_space, "sigma_px", (0.5, 1, 2, 4, 8)),
    *_grades("jitter in time, us", damage.jittered_in_time, "sigma_us", (1e2, 1e3, 3e3, 1e4, 3e4)),
    *_grades("hot pixels, share", damage.with_hot_pixels, "share", (5e-4, 1e-3, 2e-3, 5e-3, 1e-2)),
)


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
        raise ValueError(
            "Expected a real stream with events to make anchors of, got an empty one; give one "
            "that has some, or another time with start_us and stop_us"
        )
    start = int(real.t[0]) if start_us is None else start_us
    stop = int(real.t[-1]) + 1 if stop_us is None else stop_us
    made = {
        "identical": real,
        "ceiling": damage.thinned(real, 0.1, seed=seed, key=key),
        "thinned_50": damage.thinned(real, 0.5, seed=seed, key=key),
        "shifted_1px": damage.shifted_in_space(real, columns=1),
        "shifted_4px": damage.shifted_in_space(real, columns=4),
        "shuffled": damage.shuffled_in_windows(real, window_us, start_us=start, seed=seed, key=key),
        "polarity_flipped": damage.polarity_flipped(real),
        "noise_50": damage.with_noise(real, 0.5, seed=seed, key=key),
        "poisson": damage.poisson(real, start_us=start, stop_us=stop, seed=seed, key=key),
        "blank": damage.blank(real),
    }
    if frame_times_us is not None:
        made["frame_locked"] = damage.frame_locked(real, frame_times_us)
    if other is not None:
        made["chance"] = damage.on_clock_of(other, start, stop)
    return made


def singles(real: Events, *, seed: int = 0, key: str = "", **given: Any) -> dict[str, Events]:  # noqa: ANN401
    """The anchors and, beside them, every other corruption of the sanity battery.

    Arguments and errors as for `anchors`.
    """
    jittered = partial(damage.jittered_in_time, real, seed=seed, key=key)
    known = anchors(real, seed=seed, key=key, **given)
    return {
        **known,
        "jitter_0.1ms": jittered(100),
        "jitter_1ms": jittered(1_000),
        "jitter_10ms": jittered(10_000),
        "reversed": damage.reversed_in_time(real),
        "hot_pixels": damage.with_hot_pixels(real, seed=seed, key=key),
        "double_threshold": damage.at_double_threshold(real),
    }
