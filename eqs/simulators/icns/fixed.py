"""The pixels of ICNS in continuous time."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.kernels import njit
from eqs.simulators.icns.latency import SEEING, Delays, latency
from eqs.simulators.icns.parameters import ICNS
from eqs.simulators.pixel.photoreceptor import MICROSECONDS
from eqs.simulators.pixel.ramp_response import first_crossing, response
from eqs.simulators.pixel.randomness import draw_key, uniform, word_at
from eqs.simulators.pixel.thresholds import (
    SMALLEST_THRESHOLD_LOG,
    Sides,
    ThresholdLaw,
    redraw,
    threshold_maps,
)
from eqs.simulators.streaming.keys import Fired, event_key, with_room
from eqs.simulators.streaming.pixels import Interval


class SeenLight(NamedTuple):
    """An image as pixels see it: by grey level the signal and the inverse root of the light."""

    codes: NDArray[Any]
    signal: NDArray[np.float64]
    inverse_root: NDArray[np.float64]


class Voltages(NamedTuple):
    """The state of all pixels: voltage, that of the last reset, end of the refractory period."""

    voltage: NDArray[np.float64]
    reset: NDArray[np.float64]
    ready_us: NDArray[np.float64]


class ICNSPixels:
    """Voltages, resets and thresholds of all pixels."""

    def __init__(self, model: ICNS, image: GreyImage, sequence: str) -> None:
        """Settle on the first image."""
        self.model = model
        self.sequence = sequence
        self.seen = self._seen(image)
        self.voltage = self.seen.signal[image.codes]
        self.reset = self.voltage.copy()
        # Copies, as thresholds are drawn anew.
        self.on, self.off = (side.copy() for side in threshold_maps(model, image))
        self.background = model.background_hz(image)
        self.ready_us = np.full(self.voltage.size, SEEING)
        self.keys = np.empty(self.voltage.size, np.int64)

    def _seen(self, image: GreyImage) -> SeenLight:
        signal = self.model.signal(image.levels)
        return SeenLight(image.codes, signal, np.exp(-0.5 * signal))

    def advance(self, image: GreyImage, interval: Interval) -> NDArray[np.int64]:
        """Events of one interval."""
        model = self.model
        before, self.seen = self.seen, self._seen(image)
        self.keys, count = _fire(
            before,
            self.seen,
            Voltages(self.voltage, self.reset, self.ready_us),
            Sides(self.on, self.off),
            ThresholdLaw(
                model.threshold_on_log, model.threshold_off_log, model.threshold_sigma_log
            ),
            Delays(float(model.latency_us), float(model.jitter_us), float(model.refractory_us)),
            float(model.time_constant_us),
            Sides(*self.background),
            draw_key(
                model.seed,
                "events",
                self.sequence,
                str(interval.frame),
                first_pixel=image.first_pixel,
            ),
            float(interval.start_us),
            float(interval.stop_us),
            self.keys,
        )
        return self.keys[:count]


@njit(cache=True)
def _background_wait(word: np.uint64, rate_per_us: float, left_us: float) -> float:
    """Time until the next background event, or more than is left."""
    share = uniform(word)
    if share >= rate_per_us * left_us:  # -ln(1 - u) >= u spares the logarithm nearly always
        return math.inf
    return -math.log(1.0 - share) / rate_per_us


@njit(cache=True, nogil=True)
def _fire(
    start: SeenLight,
    end: SeenLight,
    state: Voltages,
    thresholds: Sides,
    law: ThresholdLaw,
    delays: Delays,
    time_constant_us: float,
    background_hz: Sides,
    frame_key: np.uint64,
    start_us: float,
    stop_us: float,
    keys: NDArray[np.int64],
) -> Fired:
    voltage, reset, ready_us = state
    on, off = thresholds
    count = 0
    for pixel in range(voltage.size):
        codes = start.codes[pixel], end.codes[pixel]
        first, last = start.signal[codes[0]], end.signal[codes[1]]
        slope = (last - first) / (stop_us - start_us)
        tau_us = (
            time_constant_us * 1000.0 * start.inverse_root[codes[0]] * end.inverse_root[codes[1]]
        )
        level, now_us = voltage[pixel], start_us
        on_rate = background_hz.on[pixel] * MICROSECONDS
        rate = on_rate + background_hz.off[pixel] * MICROSECONDS
        pixel_key, ordinal = word_at(frame_key, pixel), 0
        while True:
            light = first + slope * (now_us - start_us)
            if ready_us[pixel] != SEEING:
                if ready_us[pixel] >= stop_us:
                    break
                level = response(level, light, slope, tau_us, ready_us[pixel] - now_us)
                now_us, reset[pixel], ready_us[pixel] = (
                    ready_us[pixel],
                    level,
                    SEEING,
                )
                light = first + slope * (now_us - start_us)
            word = word_at(pixel_key, ordinal)
            ordinal += 1
            wait_us = _background_wait(word_at(word, 0), rate, stop_us - now_us)
            limit_us = min(wait_us, stop_us - now_us)
            bounds = (reset[pixel] - off[pixel], reset[pixel] + on[pixel])
            crossed_us, up = first_crossing(level, light, slope, tau_us, limit_us, bounds)
            if crossed_us <= limit_us:
                now_us += crossed_us
                light += slope * crossed_us
                level = bounds[int(up)]
                blur_us = law.sigma_log * tau_us / max(abs(light - level), 1e-12)
                event_us = now_us + latency(
                    delays.latency_us, delays.jitter_us, blur_us, word_at(word, 1)
                )
                side, mean = (on, law.on_log) if up else (off, law.off_log)
                redraw(side, pixel, mean, law.sigma_log, SMALLEST_THRESHOLD_LOG, word_at(word, 2))
            elif now_us + wait_us < stop_us:
                level = response(level, light, slope, tau_us, wait_us)
                now_us += wait_us
                event_us = now_us
                up = uniform(word_at(word, 1)) * rate < on_rate
            else:
                break
            keys = with_room(keys, count + 1)
            keys[count] = event_key(int(event_us), pixel, 1 if up else 0)
            count += 1
            ready_us[pixel] = event_us + delays.refractory_us
        light = first + slope * (now_us - start_us)
        voltage[pixel] = response(level, light, slope, tau_us, stop_us - now_us)
    return keys, count
