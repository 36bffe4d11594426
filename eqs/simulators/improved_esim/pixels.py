"""The pixels of the improved ESIM: filter, exact leak, reset to the signal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.kernels import njit
from eqs.simulators.improved_esim.bandwidth import PixelFilter
from eqs.simulators.improved_esim.parameters import ImprovedESIM
from eqs.simulators.pixel.crossing import RELATIVE_TOLERANCE
from eqs.simulators.pixel.photoreceptor import MICROSECONDS
from eqs.simulators.pixel.randomness import draw_key, uniform_map
from eqs.simulators.pixel.thresholds import threshold_maps
from eqs.simulators.streaming.keys import Fired, event_key, with_room
from eqs.simulators.streaming.pixels import Interval


class ImprovedESIMPixels:
    """Filter, mismatch and refractory period of all pixels, and how far each is above its reset."""

    def __init__(self, model: ImprovedESIM, image: GreyImage, sequence: str) -> None:
        """Settle on the first image."""
        self.model = model
        pixels, seed = image.codes.size, model.seed
        self.on, self.off = threshold_maps(model, image)
        self.filter = PixelFilter(model, image)
        self.above = np.zeros(pixels)
        first_pixel = image.first_pixel
        if model.leaks:
            key = draw_key(seed, "leak phase", sequence, first_pixel=first_pixel)
            self.above = self.on * uniform_map(key, pixels)
        self.ready_us = np.zeros(pixels)
        if model.refractory_us > 0 and not model.leaks:
            key = draw_key(seed, "first blindness", sequence, first_pixel=first_pixel)
            self.ready_us = model.refractory_us * uniform_map(key, pixels)
        self.keys = np.empty(pixels, np.int64)

    def advance(self, image: GreyImage, interval: Interval) -> NDArray[np.int64]:
        """Events of one interval."""
        before = self.filter.output
        after = self.filter.advance(image, interval.span_us)
        self.keys, count = _fire(
            before,
            after,
            self.above,
            self.ready_us,
            self.on,
            self.off,
            self.model.leak_hz * MICROSECONDS if self.model.leaks else 0.0,
            float(self.model.refractory_us),
            interval.start_us,
            interval.span_us,
            self.keys,
        )
        return self.keys[:count]


@njit(cache=True, nogil=True)
def _fire(
    before: NDArray[np.float64],
    after: NDArray[np.float64],
    above: NDArray[np.float64],
    ready_us: NDArray[np.float64],
    on: NDArray[np.float64],
    off: NDArray[np.float64],
    leaks_per_us: float,
    refractory_us: float,
    start_us: int,
    span_us: int,
    keys: NDArray[np.int64],
) -> Fired:
    limit_us = span_us * (1.0 + RELATIVE_TOLERANCE)
    count = 0
    for pixel in range(before.size):
        slope = (after[pixel] - before[pixel]) / span_us + leaks_per_us * on[pixel]
        distance, offset_us = above[pixel], 0.0
        polarity = 1 if slope > 0 else 0
        step = on[pixel] if polarity else -off[pixel]
        while True:
            if ready_us[pixel] > start_us + offset_us:
                offset_us, distance = ready_us[pixel] - start_us, 0.0
            if offset_us >= span_us:
                break
            wait_us = max((step - distance) / slope, 0.0) if slope != 0.0 else np.inf
            if offset_us + wait_us > limit_us:
                distance += slope * (span_us - offset_us)
                break
            offset_us = min(offset_us + wait_us, float(span_us))
            distance = 0.0
            keys = with_room(keys, count + 1)
            keys[count] = event_key(start_us + int(offset_us), pixel, polarity)
            count += 1
            ready_us[pixel] = start_us + offset_us + refractory_us
        above[pixel] = distance
    return keys, count
