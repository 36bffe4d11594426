"""The pixels of V2E in continuous time."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.kernels import njit
from eqs.simulators.pixel.level_memory import LevelMemory
from eqs.simulators.pixel.noise import shot_events
from eqs.simulators.pixel.photoreceptor import MICROSECONDS, filter_share, lin_log
from eqs.simulators.pixel.randomness import (
    NORMAL_QUANTILES,
    draw_key,
    normal_map,
    normal_quantile,
    word_at,
)
from eqs.simulators.pixel.thresholds import threshold_maps
from eqs.simulators.streaming.keys import Fired
from eqs.simulators.streaming.pixels import Interval
from eqs.simulators.v2e.parameters import V2E


class V2EPixels:
    """Filter, mismatch and leak of all pixels, and how far each is above its memory."""

    precision: ClassVar[Any] = np.float64

    def __init__(self, model: V2E, image: GreyImage, sequence: str) -> None:
        """Settle on the first image."""
        self.model = model
        self.sequence = sequence
        pixels = image.codes.size
        on, off = threshold_maps(model, image)
        self.on, self.off = self._stored(on), self._stored(off)
        self.leak_per_second = self._stored(self._leaks(on))
        signal = lin_log(image.levels, model.knee_level)
        self.filtered = signal[image.codes].astype(self.precision)
        self.keys = np.empty(pixels, np.int64)
        self._begin()

    def _stored(self, values: NDArray[np.float64]) -> NDArray[Any]:
        if values.strides == (0,):
            return np.broadcast_to(self.precision(values[0]), values.shape)
        return values.astype(self.precision)

    def _leaks(self, on: NDArray[np.float64]) -> NDArray[np.float64]:
        model, pixels = self.model, on.size
        if model.leak_hz == 0:
            return np.broadcast_to(np.float64(0), (pixels,))
        spread = normal_map(draw_key(model.seed, "leak spread"), pixels)
        return model.leak_hz * on * 10.0 ** (model.leak_spread_decades * spread)

    def _begin(self) -> None:
        """Nothing has fired, but pixels that leak are somewhere on their way."""
        self.memory = LevelMemory(self.on, self.off)
        if self.model.leak_hz > 0:
            self.memory.start_on_the_way(self.model.seed, self.sequence)

    def advance(self, image: GreyImage, interval: Interval) -> NDArray[np.int64]:
        """Events of one interval."""
        model = self.model
        signal = lin_log(image.levels, model.knee_level).astype(self.precision)
        share = filter_share(image.levels, model.cutoff_hz, interval.span_us)
        shot = shot_events(image.levels, model.shot_noise_hz, interval.span_us)
        share = share.astype(self.precision)
        self.keys, count = self._fire(image.codes, signal, share, shot, interval)
        return self.keys[:count]

    def _fire(
        self,
        codes: NDArray[Any],
        signal: NDArray[Any],
        share: NDArray[Any],
        shot: NDArray[np.float64],
        interval: Interval,
    ) -> Fired:
        model = self.model
        noise_key = draw_key(model.seed, "noise", self.sequence, str(interval.frame))
        leak_jitter = model.leak_jitter if model.leak_hz > 0 else 0.0
        _move(
            codes,
            signal,
            share,
            self.filtered,
            self.memory.above,
            self.memory.moved,
            self.leak_per_second,
            interval.span_us * MICROSECONDS,
            leak_jitter,
            noise_key,
            NORMAL_QUANTILES,
        )
        dead_us = float(model.refractory_us)
        fired = self.memory.fire(interval, dead_us, self.keys, keeps_contrast=True)
        if model.shot_noise_hz == 0:
            return fired
        nominal = (model.threshold_on_log, model.threshold_off_log)
        return self.memory.add_noise(interval, codes, shot, nominal, noise_key, fired)


@njit(cache=True, nogil=True)
def _move(
    codes: NDArray[Any],
    signal: NDArray[np.float64],
    share: NDArray[np.float64],
    filtered: NDArray[np.float64],
    above: NDArray[np.float64],
    moved: NDArray[np.float64],
    leak_per_second: NDArray[np.float64],
    seconds: float,
    leak_jitter: float,
    noise_key: np.uint64,
    quantiles: NDArray[np.float64],
) -> None:
    """Filter and leak: how far each pixel is above its memory when the interval ends."""
    for pixel in range(codes.size):
        before, weight = filtered[pixel], share[codes[pixel]]
        after = (1.0 - weight) * before + weight * signal[codes[pixel]]
        filtered[pixel] = after
        moved[pixel] = above[pixel] + (after - before) + leak_per_second[pixel] * seconds
    if leak_jitter > 0:
        for pixel in range(codes.size):
            jitter = leak_jitter * normal_quantile(word_at(noise_key, pixel), quantiles)
            moved[pixel] -= leak_per_second[pixel] * seconds * jitter
