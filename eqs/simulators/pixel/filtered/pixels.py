"""The filtered pixels of a sensor, interval by interval."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.kernels import njit
from eqs.simulators.pixel.filtered.circuit import (
    SEEING,
    Circuit,
    Comparator,
    Pixel,
    Ramp,
    Seen,
    cannot_fire,
    settled,
)
from eqs.simulators.pixel.filtered.crossings import fire_signal
from eqs.simulators.pixel.filtered.noise_events import fire_noise, may_fire
from eqs.simulators.pixel.randomness import draw_key, word_at
from eqs.simulators.pixel.thresholds import Sides, Thresholded, threshold_maps
from eqs.simulators.streaming.keys import Fired
from eqs.simulators.streaming.pixels import Interval


class State(NamedTuple):
    """What all pixels hold, see `Pixel`."""

    received: NDArray[np.float64]
    filtered: NDArray[np.float64]
    memory: NDArray[np.float64]
    ready_us: NDArray[np.float64]
    last_us: NDArray[np.float64]


class FilteredModel(Thresholded, Protocol):
    """What the pixels ask of a simulator."""

    def circuit(self) -> Circuit:
        """What all pixels share."""

    def seen(self, image: GreyImage) -> Seen:
        """An image as pixels see it."""


class FilteredPixels:
    """Filters, memories and thresholds of all pixels."""

    def __init__(self, model: FilteredModel, image: GreyImage, sequence: str) -> None:
        """Settle on the first image."""
        self.model, self.sequence, self.circuit = model, sequence, model.circuit()
        self.image = model.seen(image)
        light = self.image.light_log[image.codes]
        sees = np.full(light.size, SEEING)
        self.state = State(light, light.copy(), light.copy(), sees, sees.copy())
        self.thresholds = threshold_maps(model, image)
        self.keys = np.empty(light.size, np.int64)

    def advance(self, image: GreyImage, interval: Interval) -> NDArray[np.int64]:
        """Events of one interval."""
        before, self.image = self.image, self.model.seen(image)
        names = "noise", self.sequence, str(interval.frame)
        self.keys, count = _fire(
            before,
            self.image,
            self.state,
            self.thresholds,
            self.circuit,
            draw_key(self.model.seed, *names, first_pixel=image.first_pixel),
            (float(interval.start_us), float(interval.stop_us)),
            self.keys,
        )
        return self.keys[:count]


@njit(cache=True, nogil=True)
def _fire(
    start: Seen,
    end: Seen,
    state: State,
    thresholds: Sides,
    circuit: Circuit,
    frame_key: np.uint64,
    span: tuple[float, float],
    keys: NDArray[np.int64],
) -> Fired:
    """Events of an interval in which the log light of every pixel is a line."""
    count = 0
    span_us = span[1] - span[0]
    for index in range(end.codes.size):
        code = end.codes[index]
        before = start.codes[index]
        first = start.light_log[before]
        slope = (end.light_log[code] - first) / span_us
        ramp = Ramp(first, slope, start.tau_us[before], end.leak[code])
        comparator = Comparator(
            thresholds.on[index], thresholds.off[index], end.noise_log[code], end.noise_us[code]
        )
        pixel = Pixel(
            state.received[index],
            state.filtered[index],
            state.memory[index],
            state.ready_us[index],
            state.last_us[index],
        )
        key = word_at(frame_key, index)
        if pixel.ready_us <= span[0] and cannot_fire(pixel, ramp, span_us, comparator):
            pixel = settled(pixel, ramp, span_us, circuit)
            if may_fire(pixel, comparator):
                pixel, keys, count = fire_noise(
                    pixel, comparator, circuit, span, key, index, keys, count
                )
        else:
            pixel, keys, count = fire_signal(
                pixel, ramp, comparator, circuit, span, key, index, keys, count
            )
        state.received[index], state.filtered[index] = pixel.received, pixel.filtered
        state.memory[index] = pixel.memory
        state.ready_us[index], state.last_us[index] = pixel.ready_us, pixel.last_us
    return keys, count
