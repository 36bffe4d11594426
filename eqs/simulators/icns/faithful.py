"""The pixels of ICNS as the published program has them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.kernels import njit
from eqs.simulators.icns.latency import SEEING, Delays, latency
from eqs.simulators.icns.parameters import ICNS
from eqs.simulators.pixel.photoreceptor import MICROSECONDS
from eqs.simulators.pixel.randomness import draw_key, uniform_map, word_at
from eqs.simulators.pixel.thresholds import Sides, ThresholdLaw, redraw, threshold_maps
from eqs.simulators.streaming.keys import Fired, event_key, with_room
from eqs.simulators.streaming.pixels import Interval

_SMALLEST_REST = 1e-300


class FaithfulICNSPixels:
    """Each image is a step that acts from the frame before on."""

    def __init__(self, model: ICNS, image: GreyImage, sequence: str) -> None:
        """Settle on the first image."""
        self.model = model
        self.sequence = sequence
        self.voltage = model.signal(image.levels)[image.codes]
        self.reset = self.voltage.copy()
        self.tau_us = self._time_constants(self.voltage)
        # Copies, as thresholds are drawn anew.
        self.on, self.off = (side.copy() for side in threshold_maps(model, image))
        self.ready_us = np.full(self.voltage.size, SEEING)
        on_hz, off_hz = model.background_hz(image)
        self.on_us, self.on_period_us = self._background(on_hz, "on")
        self.off_us, self.off_period_us = self._background(off_hz, "off")
        self.keys = np.empty(self.voltage.size, np.int64)

    def _time_constants(self, signal: NDArray[np.float64]) -> NDArray[np.float64]:
        return self.model.time_constant_us * 1000.0 * np.exp(-signal)

    def _background(
        self, rates_hz: NDArray[np.float64], name: str
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times of the first background events, anywhere in a period, and the periods."""
        if not rates_hz.any():
            silence = np.full(rates_hz.size, np.inf)
            return silence, silence
        periods_us = 1.0 / (MICROSECONDS * rates_hz)
        key = draw_key(self.model.seed, "background phase", self.sequence, name)
        return periods_us * uniform_map(key, rates_hz.size), periods_us

    def advance(self, image: GreyImage, interval: Interval) -> NDArray[np.int64]:
        """Events of one interval."""
        model = self.model
        signal = model.signal(image.levels)
        self.keys, count = _fire(
            image.codes,
            signal,
            self._time_constants(signal),
            self.voltage,
            self.reset,
            self.tau_us,
            self.ready_us,
            Sides(self.on, self.off),
            ThresholdLaw(
                model.threshold_on_log, model.threshold_off_log, model.threshold_sigma_log
            ),
            Delays(float(model.latency_us), float(model.jitter_us), float(model.refractory_us)),
            (self.on_us, self.off_us),
            (self.on_period_us, self.off_period_us),
            draw_key(model.seed, "events", self.sequence, str(interval.frame)),
            float(interval.start_us),
            float(interval.stop_us),
            self.keys,
        )
        return self.keys[:count]


@njit(cache=True)
def _follow(voltage: float, target: float, steps: float) -> float:
    """The voltage after so many time constants; before black it stands still."""
    if target == 0.0:
        return voltage
    return target + (voltage - target) * math.exp(-steps)


@njit(cache=True)
def _delay(
    voltage: float,
    level: float,
    target: float,
    tau_us: float,
    sigma_log: float,
    delays: Delays,
    word: np.uint64,
) -> float:
    """Time from a voltage to the event at a level on its way to the target."""
    way = target - voltage
    rest = max(1.0 - (level - voltage) / way, _SMALLEST_REST)
    blur_us = abs(sigma_log * tau_us / way)
    return latency(delays.latency_us - tau_us * math.log(rest), delays.jitter_us, blur_us, word)


@njit(cache=True, nogil=True)
def _fire(
    codes: NDArray[Any],
    signal: NDArray[np.float64],
    time_constants: NDArray[np.float64],
    voltage: NDArray[np.float64],
    reset: NDArray[np.float64],
    tau_us: NDArray[np.float64],
    ready_us: NDArray[np.float64],
    thresholds: Sides,
    law: ThresholdLaw,
    delays: Delays,
    background_us: tuple[NDArray[np.float64], NDArray[np.float64]],
    periods_us: tuple[NDArray[np.float64], NDArray[np.float64]],
    frame_key: np.uint64,
    start_us: float,
    stop_us: float,
    keys: NDArray[np.int64],
) -> Fired:
    on, off = thresholds
    count = 0
    for pixel in range(codes.size):
        target, now_us = signal[codes[pixel]], start_us
        if target > 0.0:  # the program forgets the time constant of black pixels
            tau_us[pixel] = time_constants[codes[pixel]]
        tau, level, ordinal = tau_us[pixel], voltage[pixel], 0
        pixel_key = word_at(frame_key, pixel)
        if SEEING < ready_us[pixel] < stop_us:
            level = _follow(level, target, (ready_us[pixel] - now_us) / tau)
            now_us, reset[pixel], ready_us[pixel] = (
                ready_us[pixel],
                level,
                SEEING,
            )
        for off_side in range(2):
            if background_us[off_side][pixel] < stop_us:
                # Where the period is shorter than the interval the program falls behind.
                now_us = max(background_us[off_side][pixel], start_us)
                keys = with_room(keys, count + 1)
                keys[count] = event_key(int(now_us), pixel, 1 - off_side)
                count += 1
                level = reset[pixel] = target
                background_us[off_side][pixel] += periods_us[off_side][pixel]
        while ready_us[pixel] == SEEING and level != target:
            change = _follow(level, target, (stop_us - now_us) / tau) - reset[pixel]
            if target == 0.0:
                change = -reset[pixel]
            if -off[pixel] <= change <= on[pixel]:
                break
            up = change > 0
            word = word_at(pixel_key, ordinal)
            crossed = reset[pixel] + (on[pixel] if up else -off[pixel])
            wait_us = _delay(level, crossed, target, tau, law.sigma_log, delays, word_at(word, 0))
            event_us = math.floor(now_us + math.floor(wait_us))
            keys = with_room(keys, count + 1)
            keys[count] = event_key(int(event_us), pixel, 1 if up else 0)
            count += 1
            ordinal += 1
            side, mean = (on, law.on_log) if up else (off, law.off_log)
            redraw(side, pixel, mean, law.sigma_log, 0.0, word_at(word, 1))
            ready_us[pixel] = event_us + delays.refractory_us
            if ready_us[pixel] < stop_us:
                level = _follow(level, target, (ready_us[pixel] - now_us) / tau)
                now_us, reset[pixel], ready_us[pixel] = (
                    ready_us[pixel],
                    level,
                    SEEING,
                )
        voltage[pixel] = _follow(level, target, (stop_us - now_us) / tau)
    return keys, count
