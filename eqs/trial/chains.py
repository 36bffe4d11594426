"""Chains of streams in a known order, each a step further from the real one than the one before."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eqs.events import Events
from eqs.metrics import corruptions as damage
from eqs.scenes import EventSensor

PICTURES_AT_ONCE: Final = 50
CEILING: Final = "ceiling"  # where every chain begins, step 0

# By kind: what there is more or less of, and by which factors.
SENSOR_STEPS: Final = {
    "contrast lower": ("contrast", (0.7, 0.5)),
    "contrast higher": ("contrast", (1.4, 2.0)),
    "slower": ("slowness", (4.0, 16.0)),
    "more noise": ("noise", (1.7, 3.0)),
    "less noise": ("noise", (0.5, 0.0)),
    "more leak": ("leak", (10.0, 100.0)),
    "no leak": ("leak", (0.0,)),
    "hot pixels": ("hot_pixels", (10.0, 50.0)),
    "refractory": ("refractory", (5.0, 25.0)),
    "mismatch": ("mismatch", (3.0, 6.0)),
    "latency jitter": ("jitter", (10.0, 50.0)),
    "more ON": ("balance", (1.25, 1.6)),
    "more OFF": ("balance", (0.8, 0.625)),
}
RATES_HZ: Final = (100, 40, 20)
GAMMAS: Final = (1.5, 2.2)


class Level(NamedTuple):
    """One stream of a chain.

    Args:
        kind: what it differs in.
        step: how far along the chain, from 1.
        make: makes it.
    """

    kind: str
    step: int
    make: Callable[[], Events]


def record(sensor: EventSensor, pictures: NDArray[np.float32], key: tuple[int, ...]) -> Events:
    """What a camera makes of pictures of light, lux, shape (n, H, W), one a step of its own."""
    stream = sensor.start(*pictures.shape[1:], noise_key=key)
    starts = range(0, len(pictures), PICTURES_AT_ONCE)
    parts = [stream.step(pictures[k : k + PICTURES_AT_ONCE]) for k in starts]
    return Events.concatenate([*parts, stream.finish()])


def sensor_chains(
    sensor: EventSensor, pictures: NDArray[np.float32], key: tuple[int, ...]
) -> Iterator[Level]:
    """The camera looking at the same light again with one thing changed in steps.

    Kinds that the camera has no parameter for are left out.

    Args:
        sensor: the camera of the ceiling.
        pictures: light, lux, one picture a step of the camera.
        key: names the noise of the ceiling, which all share.
    """
    for kind, (quantity, factors) in SENSOR_STEPS.items():
        if quantity in sensor.scales:
            for step, factor in enumerate(factors, 1):
                yield Level(
                    kind, step, partial(record, sensor.scaled(quantity, factor), pictures, key)
                )
    for kind, view in (("light between frames", between), ("light held", held)):
        for step, rate_hz in enumerate(RATES_HZ, 1):
            every = round(1e6 / rate_hz / sensor.step_us)
            yield Level(
                kind, step, partial(seen, sensor, pictures, key, partial(view, every=every))
            )
    for step, gamma in enumerate(GAMMAS, 1):
        yield Level(
            "tone curve", step, partial(seen, sensor, pictures, key, partial(toned, gamma=gamma))
        )


def seen(
    sensor: EventSensor,
    pictures: NDArray[np.float32],
    key: tuple[int, ...],
    change: Callable[[NDArray[np.float32]], NDArray[np.float32]],
) -> Events:
    """What a camera makes of changed pictures."""
    return record(sensor, change(pictures), key)


def between(pictures: NDArray[np.float32], every: int) -> NDArray[np.float32]:
    """Every so many pictures, and straight lines in between."""
    index = np.arange(len(pictures))
    before = index // every * every
    after = np.minimum(before + every, len(pictures) - 1)
    span = np.maximum(after - before, 1)
    share = ((index - before) / span).astype(np.float32)[:, None, None]
    mixed: NDArray[np.float32] = pictures[before] * (1 - share) + pictures[after] * share
    return mixed


def held(pictures: NDArray[np.float32], every: int) -> NDArray[np.float32]:
    """Every so many pictures, each shown until the next."""
    shown: NDArray[np.float32] = pictures[np.arange(len(pictures)) // every * every]
    return shown


def toned(pictures: NDArray[np.float32], gamma: float) -> NDArray[np.float32]:
    """Light through a display's curve, about its mean."""
    middle = float(pictures.mean())
    curved: NDArray[np.float32] = (middle * (pictures / middle) ** (1 / gamma)).astype(np.float32)
    return curved


def damage_chains(events: Events, *, start_us: int, stop_us: int, seed: int = 0) -> Iterator[Level]:
    """A stream damaged in steps; a person knows the order of these without a sensor."""
    random: dict[str, Any] = {"seed": seed, "key": "trial"}
    steps: dict[str, list[Callable[[], Events]]] = {
        "shifted": [partial(damage.shifted_in_space, events, columns=n) for n in (1, 2, 4, 8)],
        "dropped": [partial(damage.thinned, events, n, **random) for n in (0.3, 0.5, 0.7, 0.9)],
        "noise carpet": [
            partial(damage.with_noise, events, n, **random) for n in (0.25, 0.5, 1.0, 2.0)
        ],
        "jitter in space": [
            partial(damage.jittered_in_space, events, n, **random) for n in (1, 2, 4)
        ],
        "jitter in time": [
            partial(damage.jittered_in_time, events, n, **random) for n in (1e3, 3e3, 1e4, 3e4)
        ],
        "strobe": [
            partial(damage.frame_locked, events, np.arange(start_us, stop_us + 1, n))
            for n in (10_000, 20_000, 50_000)
        ],
        "scrambled": [
            partial(damage.shuffled_in_windows, events, n, start_us=start_us, **random)
            for n in (5_000, 20_000, 50_000)
        ],
        "polarity flipped": [
            partial(damage.some_flipped, events, n, **random) for n in (0.25, 0.5, 1.0)
        ],
    }
    for kind, makers in steps.items():
        for step, make in enumerate(makers, 1):
            yield Level(kind, step, make)
