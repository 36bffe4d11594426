"""Pixels that fire at whole thresholds above the level of their last event, in continuous time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.simulators.pixel.crossing import fire_levels, firing_pixels
from eqs.simulators.pixel.noise import noisy_pixels, scatter_noise
from eqs.simulators.pixel.randomness import draw_key, uniform_map
from eqs.simulators.streaming.keys import Fired, with_room
from eqs.simulators.streaming.pixels import Interval


class LevelMemory:
    """How far the signal of every pixel is above the level of its last event.

    A model writes to `moved` where its pixels are when an interval ends; `fire` gives the events
    on the way there from `above`, and then `above` is where they are left.

    Args:
        on: threshold of each pixel.
        off: the same for OFF, positive.
    """

    def __init__(self, on: NDArray[np.float64], off: NDArray[np.float64]) -> None:
        """Start every pixel at the level of its last event."""
        self.on, self.off = on, off
        self.least = float(on.min()), float(off.min())
        self.above, self.moved = np.zeros(on.size), np.zeros(on.size)
        self.last_us = np.full(on.size, -np.inf)
        self.chosen = np.empty(on.size, np.int32)
        self.passed = np.empty(on.size, np.int64)

    def start_on_the_way(self, seed: int, sequence: str) -> None:
        """Place each pixel somewhere on its way to the next ON event, as leaks do over time."""
        key = draw_key(seed, "leak phase", sequence)
        self.above = self.on * uniform_map(key, self.on.size)

    def fire(
        self,
        interval: Interval,
        refractory_us: float,
        keys: NDArray[np.int64],
        *,
        keeps_contrast: bool,
    ) -> Fired:
        """Events of an interval, in `keys` or a larger buffer; see `fire_levels`."""
        chosen, total = firing_pixels(self.moved, self.on, self.off, self.chosen, self.passed)
        keys = with_room(keys, total)
        count = fire_levels(
            self.chosen[:chosen],
            self.passed,
            self.above,
            self.moved,
            self.last_us,
            self.on,
            self.off,
            refractory_us,
            keeps_contrast,
            interval.start_us,
            interval.span_us,
            keys,
        )
        self.above, self.moved = self.moved, self.above
        return keys, count

    def add_noise(
        self,
        interval: Interval,
        codes: NDArray[Any],
        shot: NDArray[np.float64],
        nominal: tuple[float, float],
        noise_key: np.uint64,
        fired: Fired,
    ) -> Fired:
        """Shot noise after the events that have fired; see `noisy_pixels` and `scatter_noise`."""
        noisy, total = noisy_pixels(
            codes,
            shot,
            self.on,
            self.off,
            nominal,
            self.least,
            noise_key,
            self.chosen,
            self.passed,
        )
        keys, count = fired
        keys = with_room(keys, count + total)
        scatter_noise(
            self.chosen[:noisy],
            self.passed,
            codes,
            shot,
            self.above,
            self.on,
            self.off,
            nominal,
            noise_key,
            interval.start_us,
            interval.span_us,
            keys[count:],
        )
        return keys, count + total
