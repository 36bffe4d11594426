"""ESIM's pixels: the robust rule of crossing, thresholds that stay."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.kernels import njit
from eqs.simulators.esim.parameters import ESIM
from eqs.simulators.pixel.crossing import (
    crossing_share,
    firing_pixels,
)
from eqs.simulators.pixel.photoreceptor import Seen
from eqs.simulators.pixel.thresholds import Sides, threshold_maps
from eqs.simulators.streaming.keys import Fired, event_key, with_room
from eqs.simulators.streaming.pixels import Interval


class ESIMPixels:
    """References and last events of all pixels, robust rule, static thresholds."""

    def __init__(self, model: ESIM, image: GreyImage, sequence: str) -> None:
        """Settle on the first image."""
        self.model = model
        self.sequence = sequence
        pixels = image.codes.size
        self.codes = image.codes
        self.signal = model.signal(image.levels)
        self.reference = self.signal[image.codes]
        self.last_us = np.full(pixels if model.refractory_us > 0 else 1, -np.inf)
        self.on, self.off = threshold_maps(model, image)
        self.difference = np.empty(pixels)
        self.chosen = np.empty(pixels, np.int32)
        self.passed = np.empty(pixels, np.int64)
        self.keys = np.empty(pixels, np.int64)

    def advance(self, image: GreyImage, interval: Interval) -> NDArray[np.int64]:
        """Events of one interval."""
        signal = self.model.signal(image.levels)
        self.keys, count = self._fire(image.codes, signal, interval)
        self.codes, self.signal = image.codes, signal
        return self.keys[:count]

    def _fire(self, codes: NDArray[Any], signal: NDArray[Any], interval: Interval) -> Fired:
        _difference(codes, signal, self.reference, self.difference)
        chosen, total = firing_pixels(self.difference, self.on, self.off, self.chosen, self.passed)
        keys = with_room(self.keys, total)
        count = _fire_robust(
            self.chosen[:chosen],
            self.passed,
            Seen(self.codes, self.signal),
            Seen(codes, signal),
            self.reference,
            self.last_us,
            Sides(self.on, self.off),
            float(self.model.refractory_us),
            interval,
            keys,
        )
        return keys, count


@njit(cache=True, nogil=True)
def _difference(
    codes: NDArray[Any],
    signal: NDArray[np.float64],
    reference: NDArray[np.float64],
    difference: NDArray[np.float64],
) -> None:
    for pixel in range(codes.size):
        difference[pixel] = signal[codes[pixel]] - reference[pixel]


@njit(cache=True, nogil=True)
def _fire_robust(
    chosen: NDArray[np.int32],
    passed: NDArray[np.int64],
    start: Seen,
    end: Seen,
    reference: NDArray[np.float64],
    last_us: NDArray[np.float64],
    thresholds: Sides,
    refractory_us: float,
    interval: Interval,
    keys: NDArray[np.int64],
) -> int:
    start_us, span_us = interval.start_us, interval.stop_us - interval.start_us
    count = 0
    for index in range(chosen.size):
        pixel, levels = chosen[index], passed[index]
        first, last = start.signal[start.codes[pixel]], end.signal[end.codes[pixel]]
        polarity = 1 if levels > 0 else 0
        # Both are read, as choosing between two numbers costs no branch.
        up, down, held = thresholds.on[pixel], -thresholds.off[pixel], reference[pixel]
        step = up if levels > 0 else down
        for ordinal in range(1, abs(levels) + 1):
            level = held + ordinal * step
            offset_us = crossing_share(level, first, last) * span_us
            if refractory_us > 0:
                if start_us + offset_us - last_us[pixel] < refractory_us:
                    continue
                last_us[pixel] = start_us + offset_us
            keys[count] = event_key(start_us + int(offset_us), pixel, polarity)
            count += 1
        reference[pixel] = held + abs(levels) * step
    return count
