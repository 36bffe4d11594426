"""ESIM: an ideal pixel on log-linear interpolated frames.

Rebecq, Gehrig and Scaramuzza, "ESIM: an Open Event Camera Simulator", CoRL 2018.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numba import njit
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.simulators.base import Simulator, require_not_negative, require_positive
from eqs.simulators.crossing import (
    SMALLEST_CHANGE_LOG,
    crossing_share,
    firing_pixels,
    officially_crossed,
)
from eqs.simulators.ordering import Fired, event_key, with_room
from eqs.simulators.photoreceptor import log_intensity
from eqs.simulators.randomness import draw_key, normal, word_at
from eqs.simulators.stream import Interval
from eqs.simulators.thresholds import SMALLEST_THRESHOLD_LOG, threshold_map


@dataclass(frozen=True, kw_only=True)
class ESIM(Simulator):
    """Fires whenever the log intensity has moved by a threshold since the last event.

    The log intensity `L = ln(offset + I / 255)` is linear between frames, a pixel fires at each
    level `r + j C` it crosses and has neither bandwidth nor leak nor shot noise.

    In `fixed` mode the threshold mismatch is drawn once per pixel and the robust crossing rule
    holds. In `faithful` mode it is drawn anew for every frame and the official rule holds, which
    loses events (40 % at C = 0.2 and sigma = 0.006); the log is float32, and the first interval has
    the published program's shared buffer, which shifts the second and later events of a pixel.

    Args:
        threshold_on_log: contrast in natural-log units that fires an ON event.
        threshold_off_log: the same for OFF, as a positive number.
        threshold_sigma_log: standard deviation of the thresholds; they never fall below 0.01.
        log_offset: added to the intensity, which runs from 0 to 1, before the logarithm.
        refractory_us: a pixel drops crossings for so long after an event; the contrast is lost.
        seed: of the thresholds; matters where `threshold_sigma_log` is above 0.

    Raises:
        ValueError: a threshold or the offset is not positive, or another value is negative.

    Example:
        >>> frames = np.array([np.full((1, 1), level) for level in (64.0, 128.0)])
        >>> events = ESIM(log_offset=1e-9).simulate(frames, [0, 70_000])
        >>> events.t.tolist(), events.p.tolist()
        ([20197, 40395, 60593], [1, 1, 1])
    """

    name: ClassVar[str] = "esim"
    shares_first_buffer: ClassVar[bool] = True
    """Whether the program keeps start and reference in one buffer during the first interval."""

    threshold_on_log: float = 0.2
    threshold_off_log: float = 0.2
    threshold_sigma_log: float = 0.0
    log_offset: float = 1e-3
    refractory_us: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the parameters."""
        super().__post_init__()
        require_positive(self, "threshold_on_log", "threshold_off_log", "log_offset")
        require_not_negative(self, "threshold_sigma_log", "refractory_us")

    @property
    def stochastic(self) -> bool:
        """Only the thresholds are random."""
        return self.threshold_sigma_log > 0

    def signal(self, levels: NDArray[np.float64]) -> NDArray[Any]:
        """The signal at grey levels 0..255; rounded to float32 in `faithful` mode."""
        signal = log_intensity(levels, self.log_offset)
        return signal.astype(np.float32) if self.mode == "faithful" else signal

    def begin(self, image: GreyImage, sequence: str) -> ESIMPixels:
        """The pixels after the first frame."""
        kind = FaithfulESIMPixels if self.mode == "faithful" else ESIMPixels
        return kind(self, image, sequence)


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
        sigma, seed = model.threshold_sigma_log, model.seed
        self.on = threshold_map(model.threshold_on_log, sigma, seed, "threshold on", image)
        self.off = threshold_map(model.threshold_off_log, sigma, seed, "threshold off", image)
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
            (self.codes, self.signal),
            (codes, signal),
            self.reference,
            self.last_us,
            self.on,
            self.off,
            float(self.model.refractory_us),
            interval.start_us,
            interval.span_us,
            keys,
        )
        return keys, count


class FaithfulESIMPixels(ESIMPixels):
    """The published program's pixels: official rule, thresholds drawn anew for every frame."""

    def _fire(self, codes: NDArray[Any], signal: NDArray[Any], interval: Interval) -> Fired:
        model = self.model
        return _fire_official(
            self.codes,
            self.signal,
            codes,
            signal,
            self.reference,
            self.last_us,
            (model.threshold_on_log, model.threshold_off_log, model.threshold_sigma_log),
            draw_key(model.seed, "threshold jitter", self.sequence, str(interval.frame)),
            float(model.refractory_us),
            model.shares_first_buffer and interval.frame == 1,
            interval.start_us,
            interval.span_us,
            self.keys,
        )


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
    start: tuple[NDArray[Any], NDArray[np.float64]],
    end: tuple[NDArray[Any], NDArray[np.float64]],
    reference: NDArray[np.float64],
    last_us: NDArray[np.float64],
    on: NDArray[np.float64],
    off: NDArray[np.float64],
    refractory_us: float,
    start_us: int,
    span_us: int,
    keys: NDArray[np.int64],
) -> int:
    count = 0
    for index in range(chosen.size):
        pixel, levels = chosen[index], passed[index]
        first, last = start[1][start[0][pixel]], end[1][end[0][pixel]]
        polarity = 1 if levels > 0 else 0
        # Both are read, as choosing between two numbers costs no branch.
        up, down, held = on[pixel], -off[pixel], reference[pixel]
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


@njit(cache=True, nogil=True)
def _fire_official(
    old_codes: NDArray[Any],
    old_signal: NDArray[Any],
    codes: NDArray[Any],
    signal: NDArray[Any],
    reference: NDArray[np.float64],
    last_us: NDArray[np.float64],
    thresholds: tuple[float, float, float],
    frame_key: np.uint64,
    refractory_us: float,
    shared_buffer: bool,
    start_us: int,
    span_us: int,
    keys: NDArray[np.int64],
) -> Fired:
    on, off, sigma = thresholds
    count = 0
    for pixel in range(codes.size):
        first, last = old_signal[old_codes[pixel]], signal[codes[pixel]]
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
