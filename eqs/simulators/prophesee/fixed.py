"""The pixels of Prophesee's simulator in continuous time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.kernels import njit
from eqs.simulators.pixel.level_memory import LevelMemory
from eqs.simulators.pixel.noise import shot_events
from eqs.simulators.pixel.photoreceptor import MICROSECONDS, filter_share
from eqs.simulators.pixel.randomness import draw_key
from eqs.simulators.pixel.thresholds import threshold_map
from eqs.simulators.prophesee.parameters import Prophesee
from eqs.simulators.streaming.keys import Fired
from eqs.simulators.streaming.pixels import Interval

LARGEST_THRESHOLD_LOG = 1.0


class PropheseePixels:
    """Filters and mismatch of all pixels, and how far each is above its memory."""

    def __init__(self, model: Prophesee, image: GreyImage, sequence: str) -> None:
        """Settle on the first image."""
        self.model = model
        self.sequence = sequence
        self.first_filter = model.signal(image.levels)[image.codes]
        self.second_filter = self.first_filter.copy()
        self.on: NDArray[Any] = self._thresholds(model.threshold_on_log, "threshold on", image)
        self.off: NDArray[Any] = self._thresholds(model.threshold_off_log, "threshold off", image)
        self.keys = np.empty(image.codes.size, np.int64)
        self._begin()

    def _thresholds(self, mean_log: float, name: str, image: GreyImage) -> NDArray[np.float64]:
        model = self.model
        drawn = threshold_map(mean_log, model.threshold_sigma_log, model.seed, name, image)
        return np.minimum(drawn, LARGEST_THRESHOLD_LOG) if model.threshold_sigma_log else drawn

    def _begin(self) -> None:
        """Nothing has fired, but pixels that leak are somewhere on their way."""
        self.memory = LevelMemory(self.on, self.off)
        if self.model.leak_hz > 0:
            self.memory.start_on_the_way(self.model.seed, self.sequence)

    def advance(self, image: GreyImage, interval: Interval) -> NDArray[np.int64]:
        """Events of one interval."""
        share = filter_share(image.levels, self.model.cutoff_hz, interval.span_us)
        shot = shot_events(image.levels, self.model.shot_noise_hz, interval.span_us)
        self.keys, count = self._fire(image, share, shot, interval)
        return self.keys[:count]

    def _fire(
        self,
        image: GreyImage,
        share: NDArray[np.float64],
        shot: NDArray[np.float64],
        interval: Interval,
    ) -> Fired:
        model = self.model
        _move(
            image.codes,
            model.signal(image.levels),
            share,
            self.first_filter,
            self.second_filter,
            self.memory.above,
            self.memory.moved,
            self.on,
            model.leak_hz * interval.span_us * MICROSECONDS,
        )
        dead_us = float(model.refractory_us)
        fired = self.memory.fire(interval, dead_us, self.keys, keeps_contrast=False)
        if model.shot_noise_hz == 0:
            return fired
        nominal = (model.threshold_on_log, model.threshold_off_log)
        noise_key = draw_key(model.seed, "shot noise", self.sequence, str(interval.frame))
        return self.memory.add_noise(interval, image.codes, shot, nominal, noise_key, fired)


@njit(cache=True, nogil=True)
def _move(
    codes: NDArray[Any],
    signal: NDArray[np.float64],
    share: NDArray[np.float64],
    first_filter: NDArray[np.float64],
    second_filter: NDArray[np.float64],
    above: NDArray[np.float64],
    moved: NDArray[np.float64],
    on: NDArray[np.float64],
    leaks: float,
) -> None:
    """Filter and leak: how far each pixel is above its memory when the interval ends."""
    for pixel in range(codes.size):
        weight, before = share[codes[pixel]], second_filter[pixel]
        first = (1.0 - weight) * first_filter[pixel] + weight * signal[codes[pixel]]
        after = (1.0 - weight) * before + weight * first
        first_filter[pixel] = first
        second_filter[pixel] = after
        moved[pixel] = above[pixel] + (after - before) + leaks * on[pixel]
