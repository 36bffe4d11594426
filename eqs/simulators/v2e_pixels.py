"""The pixels of V2E in continuous time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numba import njit
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.simulators.base import Interval
from eqs.simulators.crossing import crossing_share, firing_pixels
from eqs.simulators.ordering import Fired, event_key, with_room
from eqs.simulators.photoreceptor import lin_log
from eqs.simulators.randomness import (
    NORMAL_QUANTILES,
    draw_key,
    normal_map,
    normal_quantile,
    poisson,
    uniform,
    uniform_map,
    word_at,
)
from eqs.simulators.thresholds import threshold_map

if TYPE_CHECKING:
    from eqs.simulators.v2e import V2E

MICROSECONDS = 1e-6


class V2EPixels:
    """Filter, mismatch and leak of all pixels, and how far each is above its memory."""

    precision: ClassVar[Any] = np.float64

    def __init__(self, model: V2E, image: GreyImage, sequence: str) -> None:
        """Settle on the first image."""
        self.model = model
        self.sequence = sequence
        pixels, seed, sigma = image.codes.size, model.seed, model.threshold_sigma_log
        on = threshold_map(model.threshold_on_log, sigma, seed, "threshold on", pixels)
        off = threshold_map(model.threshold_off_log, sigma, seed, "threshold off", pixels)
        self.on, self.off = self._stored(on), self._stored(off)
        self.leak_per_second = self._stored(self._leaks(on))
        signal = lin_log(image.levels, model.knee_level)
        self.filtered = signal[image.codes].astype(self.precision)
        self.last_us = np.full(pixels, -np.inf)
        self.keys = np.empty(pixels, np.int64)
        self._begin(on)

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

    def _begin(self, on: NDArray[np.float64]) -> None:
        """Place each pixel somewhere on its way to a leak event."""
        self.moved = np.zeros(on.size)
        self.chosen = np.empty(on.size + 1, np.int32)
        self.passed = np.empty(on.size + 1, np.int64)
        self.above = np.zeros(on.size)
        if self.model.leak_hz > 0:
            key = draw_key(self.model.seed, "leak phase", self.sequence)
            self.above = on * uniform_map(key, on.size)

    def advance(self, image: GreyImage, interval: Interval) -> NDArray[np.int64]:
        """Events of one interval."""
        model = self.model
        signal = lin_log(image.levels, model.knee_level).astype(self.precision)
        share = model.filter_share(image.levels, interval.span_us).astype(self.precision)
        shot = model.shot_events(image.levels, interval.span_us)
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
            self.above,
            self.moved,
            self.leak_per_second,
            interval.span_us * MICROSECONDS,
            leak_jitter,
            noise_key,
            NORMAL_QUANTILES,
        )
        chosen, total = firing_pixels(self.moved, self.on, self.off, self.chosen, self.passed)
        keys = with_room(self.keys, total)
        count = _fire_continuously(
            self.chosen[:chosen],
            self.passed,
            self.above,
            self.moved,
            self.last_us,
            self.on,
            self.off,
            float(model.refractory_us),
            interval.start_us,
            interval.span_us,
            keys,
        )
        self.above, self.moved = self.moved, self.above
        if model.shot_noise_hz == 0:
            return keys, count
        return _scatter_shot_noise(
            codes,
            shot,
            self.above,
            self.on,
            self.off,
            (model.threshold_on_log, model.threshold_off_log),
            noise_key,
            interval.start_us,
            interval.span_us,
            keys,
            count,
        )


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


@njit(cache=True, nogil=True)
def _fire_continuously(
    chosen: NDArray[np.int32],
    passed: NDArray[np.int64],
    above: NDArray[np.float64],
    moved: NDArray[np.float64],
    last_us: NDArray[np.float64],
    on: NDArray[np.float64],
    off: NDArray[np.float64],
    refractory_us: float,
    start_us: int,
    span_us: int,
    keys: NDArray[np.int64],
) -> int:
    """Fire the levels between `above` and `moved`, and take them from `moved`."""
    count = 0
    for index in range(chosen.size):
        pixel = chosen[index]
        polarity = 1 if passed[index] > 0 else 0
        step = on[pixel] if polarity else -off[pixel]
        first, last, previous_us = above[pixel], moved[pixel], last_us[pixel] - start_us
        fired = 0
        for ordinal in range(1, abs(passed[index]) + 1):
            offset_us = crossing_share(ordinal * step, first, last) * span_us
            # A crossing within the refractory period fires when that ends, as the signal of the
            # interval is still beyond the level then.
            offset_us = max(offset_us, previous_us + refractory_us)
            if offset_us > span_us:
                break
            previous_us = offset_us
            fired = ordinal
            keys[count] = event_key(start_us + int(offset_us), pixel, polarity)
            count += 1
        moved[pixel] = last - fired * step
        last_us[pixel] = start_us + previous_us
    return count


@njit(cache=True, nogil=True)
def _scatter_shot_noise(
    codes: NDArray[Any],
    shot: NDArray[np.float64],
    above: NDArray[np.float64],
    on: NDArray[np.float64],
    off: NDArray[np.float64],
    nominal: tuple[float, float],
    noise_key: np.uint64,
    start_us: int,
    span_us: int,
    keys: NDArray[np.int64],
    count: int,
) -> Fired:
    """Poisson numbers of noise events at random times; such pixels forget pending contrast."""
    for pixel in range(codes.size):
        expected_on = shot[codes[pixel]] * nominal[0] / on[pixel]
        expected_off = shot[codes[pixel]] * nominal[1] / off[pixel]
        word = word_at(noise_key, pixel)
        number = poisson(word, expected_on + expected_off)
        if number == 0:
            continue
        above[pixel] = 0.0
        on_share = expected_on / (expected_on + expected_off)
        keys = with_room(keys, count + number)
        for ordinal in range(number):
            time_us = start_us + int(uniform(word_at(word, 2 * ordinal)) * span_us)
            polarity = 1 if uniform(word_at(word, 2 * ordinal + 1)) < on_share else 0
            keys[count] = event_key(time_us, pixel, polarity)
            count += 1
    return keys, count
