"""The pixels of Prophesee's simulator as published."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.kernels import njit
from eqs.simulators.pixel.crossing import crossing_share, officially_crossed
from eqs.simulators.pixel.photoreceptor import MICROSECONDS
from eqs.simulators.pixel.randomness import draw_key, uniform, word_at
from eqs.simulators.prophesee.fixed import PropheseePixels
from eqs.simulators.streaming.keys import Fired, event_key, with_room
from eqs.simulators.streaming.pixels import Interval


class FaithfulPropheseePixels(PropheseePixels):
    """The published program's pixels: official rule, noise at the frames."""

    def _begin(self) -> None:
        self.on, self.off = self.on.astype(np.float32), self.off.astype(np.float32)
        self.reference = self.first_filter.astype(np.float64)
        self.last_us = np.full(self.on.size, -np.inf)

    def _fire(
        self,
        image: GreyImage,
        share: NDArray[np.float64],
        shot: NDArray[np.float64],
        interval: Interval,
    ) -> Fired:
        model = self.model
        keys, count, rounds = _fire_official(
            image.codes,
            model.signal(image.levels),
            share.astype(np.float32),
            self.first_filter,
            self.second_filter,
            self.reference,
            self.last_us,
            self.on,
            self.off,
            model.leak_hz * interval.span_us * MICROSECONDS,
            float(model.refractory_us),
            interval.start_us,
            interval.span_us,
            self.keys,
        )
        if rounds == 0 or model.shot_noise_hz == 0:
            return keys, count
        return _add_shot_noise(
            image.codes,
            shot / rounds,
            self.reference,
            self.on,
            self.off,
            model.threshold_on_log,
            draw_key(model.seed, "shot noise", self.sequence, str(interval.frame)),
            interval.stop_us,
            keys,
            count,
        )


@njit(cache=True, nogil=True)
def _fire_official(
    codes: NDArray[Any],
    signal: NDArray[np.float32],
    share: NDArray[np.float32],
    first_filter: NDArray[np.float32],
    second_filter: NDArray[np.float32],
    reference: NDArray[np.float64],
    last_us: NDArray[np.float64],
    on: NDArray[np.float32],
    off: NDArray[np.float32],
    leaks: float,
    refractory_us: float,
    start_us: int,
    span_us: int,
    keys: NDArray[np.int64],
) -> tuple[NDArray[np.int64], int, int]:
    """Filter, fire and leak; the last value is what shot noise is divided by, 0 for none."""
    count, rounds = 0, 0
    for pixel in range(codes.size):
        weight, first = share[codes[pixel]], second_filter[pixel]
        first_filter[pixel] += weight * (signal[codes[pixel]] - first_filter[pixel])
        second_filter[pixel] += weight * (first_filter[pixel] - first)
        last = second_filter[pixel]
        sign = 1 if last > first else -1
        step = on[pixel] if sign > 0 else -off[pixel]
        if abs(last - reference[pixel]) > abs(step):
            level, levels = reference[pixel] + step, 1
            while officially_crossed(level, first, last, sign):
                keys = with_room(keys, count + 1)
                time_us = start_us + int(crossing_share(level, first, last) * span_us)
                if time_us - last_us[pixel] >= refractory_us:
                    keys[count] = event_key(time_us, pixel, 1 if sign > 0 else 0)
                    count += 1
                    last_us[pixel] = time_us
                reference[pixel] = level
                level += step
                levels += 1
            rounds = max(rounds, levels)
        reference[pixel] -= leaks * on[pixel]
    return keys, count, rounds


@njit(cache=True, nogil=True)
def _add_shot_noise(
    codes: NDArray[Any],
    shot: NDArray[np.float64],
    reference: NDArray[np.float64],
    on: NDArray[np.float32],
    off: NDArray[np.float32],
    nominal_on: float,
    frame_key: np.uint64,
    stop_us: int,
    keys: NDArray[np.int64],
    count: int,
) -> Fired:
    """One draw per pixel decides between ON, OFF and nothing; ON thresholds count for both."""
    for pixel in range(codes.size):
        draw = uniform(word_at(frame_key, pixel))
        probability = shot[codes[pixel]] * nominal_on / on[pixel]
        if draw > 1.0 - probability:
            keys = with_room(keys, count + 1)
            keys[count] = event_key(stop_us, pixel, 1)
            reference[pixel] += on[pixel]
            count += 1
        if draw < probability:
            keys = with_room(keys, count + 1)
            keys[count] = event_key(stop_us, pixel, 0)
            reference[pixel] -= off[pixel]
            count += 1
    return keys, count
