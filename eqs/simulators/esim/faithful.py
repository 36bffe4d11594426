"""The pixels of the published ESIM: its own rule of crossing, thresholds drawn every frame."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.kernels import njit
from eqs.simulators.esim.fixed import ESIMPixels
from eqs.simulators.pixel.crossing import (
    SMALLEST_CHANGE_LOG,
    crossing_share,
    officially_crossed,
)
from eqs.simulators.pixel.photoreceptor import Seen
from eqs.simulators.pixel.randomness import draw_key, normal, word_at
from eqs.simulators.pixel.thresholds import SMALLEST_THRESHOLD_LOG, ThresholdLaw
from eqs.simulators.streaming.keys import Fired, event_key, with_room
from eqs.simulators.streaming.pixels import Interval


class FaithfulESIMPixels(ESIMPixels):
    """The published program's pixels: official rule, thresholds drawn anew for every frame."""

    def _fire(self, codes: NDArray[Any], signal: NDArray[Any], interval: Interval) -> Fired:
        model = self.model
        return _fire_official(
            Seen(self.codes, self.signal),
            Seen(codes, signal),
            self.reference,
            self.last_us,
            ThresholdLaw(
                model.threshold_on_log, model.threshold_off_log, model.threshold_sigma_log
            ),
            draw_key(model.seed, "threshold jitter", self.sequence, str(interval.frame)),
            float(model.refractory_us),
            model.shares_first_buffer and interval.frame == 1,
            interval,
            self.keys,
        )


@njit(cache=True, nogil=True)
def _fire_official(
    start: Seen,
    end: Seen,
    reference: NDArray[np.float64],
    last_us: NDArray[np.float64],
    law: ThresholdLaw,
    frame_key: np.uint64,
    refractory_us: float,
    shared_buffer: bool,
    interval: Interval,
    keys: NDArray[np.int64],
) -> Fired:
    on, off, sigma = law
    start_us, span_us = interval.start_us, interval.stop_us - interval.start_us
    count = 0
    for pixel in range(end.codes.size):
        first, last = start.signal[start.codes[pixel]], end.signal[end.codes[pixel]]
        if abs(last - first) <= SMALLEST_CHANGE_LOG:
            continue
        sign = 1 if last >= first else -1
        threshold = on if sign > 0 else off
        if sigma > 0:
            threshold += sigma * normal(word_at(frame_key, pixel))
            threshold = max(threshold, SMALLEST_THRESHOLD_LOG)
        step = np.float32(sign * threshold)
        level: Any = np.float32(reference[pixel] + step)
        while officially_crossed(level, first, last, sign):
            keys = with_room(keys, count + 1)
            offset_us = crossing_share(level, first, last) * span_us
            reference[pixel] = level
            if shared_buffer:
                first = level
            level = np.float32(level + step)
            if refractory_us > 0:
                if start_us + offset_us - last_us[pixel] < refractory_us:
                    continue
                last_us[pixel] = start_us + offset_us
            keys[count] = event_key(start_us + int(offset_us), pixel, 1 if sign > 0 else 0)
            count += 1
    return keys, count
