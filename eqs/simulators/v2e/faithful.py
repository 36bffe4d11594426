"""The pixels of V2E as the published program has them."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from eqs.kernels import njit
from eqs.simulators.pixel.photoreceptor import MICROSECONDS
from eqs.simulators.pixel.randomness import draw_key, normal, uniform, word_at
from eqs.simulators.streaming.keys import Fired, event_key, with_room
from eqs.simulators.streaming.pixels import Interval
from eqs.simulators.v2e.fixed import V2EPixels


class FaithfulV2EPixels(V2EPixels):
    """The published program's pixels, in its float32."""

    precision: ClassVar[Any] = np.float32

    def _begin(self) -> None:
        self.reference = self.filtered.copy()
        self.last_us = np.full(self.on.size, -np.inf)

    def _fire(
        self,
        codes: NDArray[Any],
        signal: NDArray[Any],
        share: NDArray[Any],
        shot: NDArray[np.float64],
        interval: Interval,
    ) -> Fired:
        model = self.model
        frame = str(interval.frame)
        passed = _count_levels(
            codes,
            signal,
            share,
            self.filtered,
            self.reference,
            self.on,
            self.off,
            self.leak_per_second,
            model.leak_jitter if model.leak_hz else 0.0,
            draw_key(model.seed, "leak jitter", self.sequence, frame),
            interval.span_us * MICROSECONDS,
        )
        rounds = int(np.abs(passed).max())
        keys, count = _fire_in_rounds(
            passed,
            rounds,
            self.reference,
            self.last_us,
            self.on,
            self.off,
            float(model.refractory_us),
            interval.start_us,
            interval.span_us,
            self.keys,
        )
        if model.shot_noise_hz == 0:
            return keys, count
        return _add_shot_noise(
            codes,
            shot,
            self.filtered,
            self.reference,
            self.on,
            self.off,
            (model.threshold_on_log, model.threshold_off_log),
            draw_key(model.seed, "shot noise", self.sequence, frame),
            interval.stop_us,
            keys,
            count,
        )


@njit(cache=True, nogil=True)
def _count_levels(
    codes: NDArray[Any],
    signal: NDArray[np.float32],
    share: NDArray[np.float32],
    filtered: NDArray[np.float32],
    memory: NDArray[np.float32],
    on: NDArray[np.float32],
    off: NDArray[np.float32],
    leak_per_second: NDArray[np.float32],
    leak_jitter: float,
    frame_key: np.uint64,
    seconds: float,
) -> NDArray[np.int64]:
    """Filter, leak, and the signed number of levels each pixel has passed."""
    passed = np.empty(codes.size, np.int64)
    for pixel in range(codes.size):
        code = codes[pixel]
        weight = share[code]
        filtered[pixel] = (np.float32(1) - weight) * filtered[pixel] + weight * signal[code]
        leak = leak_per_second[pixel] * seconds
        if leak_jitter > 0:
            leak *= 1.0 - leak_jitter * normal(word_at(frame_key, pixel))
        memory[pixel] -= np.float32(leak)
        difference = filtered[pixel] - memory[pixel]
        if difference >= 0:
            passed[pixel] = int(difference / on[pixel])
        else:
            passed[pixel] = -int(-difference / off[pixel])
    return passed


@njit(cache=True, nogil=True)
def _fire_in_rounds(
    passed: NDArray[np.int64],
    rounds: int,
    memory: NDArray[np.float32],
    last_us: NDArray[np.float64],
    on: NDArray[np.float32],
    off: NDArray[np.float32],
    refractory_us: float,
    start_us: int,
    span_us: int,
    keys: NDArray[np.int64],
) -> Fired:
    """Fire the i-th event of every pixel in the i-th of `rounds` equal parts of the interval."""
    waits = rounds > 0 and refractory_us > span_us / rounds
    count = 0
    for pixel in range(passed.size):
        number = abs(passed[pixel])
        if number == 0:
            continue
        keys = with_room(keys, count + number)
        polarity = 1 if passed[pixel] > 0 else 0
        accepted = 0
        for ordinal in range(1, number + 1):
            time_us = start_us + ordinal * span_us / rounds
            if waits:
                if time_us - last_us[pixel] <= refractory_us:
                    continue
                last_us[pixel] = time_us
            keys[count] = event_key(start_us + ordinal * span_us // rounds, pixel, polarity)
            count += 1
            accepted += 1
        step = on[pixel] if polarity else -off[pixel]
        memory[pixel] += np.float32(accepted) * step
    return keys, count


@njit(cache=True, nogil=True)
def _add_shot_noise(
    codes: NDArray[Any],
    shot: NDArray[np.float64],
    filtered: NDArray[np.float32],
    memory: NDArray[np.float32],
    on: NDArray[np.float32],
    off: NDArray[np.float32],
    nominal: tuple[float, float],
    frame_key: np.uint64,
    stop_us: int,
    keys: NDArray[np.int64],
    count: int,
) -> Fired:
    """One draw per pixel decides between ON, OFF and nothing, at the time of the frame."""
    for pixel in range(codes.size):
        draw = uniform(word_at(frame_key, pixel))
        probability = shot[codes[pixel]]
        fires_on = draw > 1.0 - probability * nominal[0] / on[pixel]
        fires_off = draw < probability * nominal[1] / off[pixel]
        if fires_on or fires_off:
            keys = with_room(keys, count + 2)
            if fires_on:
                keys[count] = event_key(stop_us, pixel, 1)
                count += 1
            if fires_off:
                keys[count] = event_key(stop_us, pixel, 0)
                count += 1
            memory[pixel] = filtered[pixel]
    return keys, count
