"""Prophesee: the video-to-event simulator of OpenEB, a pixel between ESIM's and v2e's.

Metavision "video to event" on the CPU, part of Prophesee's OpenEB (core_ml).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numba import njit
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.simulators.base import Interval, Simulator, require_not_negative, require_positive
from eqs.simulators.crossing import crossing_share, fire_levels, firing_pixels, officially_crossed
from eqs.simulators.noise import scatter_noise, shot_events
from eqs.simulators.ordering import Fired, event_key, with_room
from eqs.simulators.photoreceptor import MICROSECONDS, filter_share, log_intensity
from eqs.simulators.randomness import draw_key, uniform, uniform_map, word_at
from eqs.simulators.thresholds import threshold_map

LARGEST_THRESHOLD_LOG = 1.0


@dataclass(frozen=True, kw_only=True)
class Prophesee(Simulator):
    """Level crossings of a log intensity that two filters have smoothed, with leak and shot noise.

    Each frame moves a first filter towards `ln(offset + I / 255)` and a second one towards the
    first, both by `min(1, q 2 pi cutoff dt)` with the light `q = (I + 20) / 275`. The second is
    linear between frames, and a pixel fires at each level it crosses. Thresholds differ from pixel
    to pixel, between 0.01 and 1. The memory leaks towards ON events. Shot noise fires both
    polarities at `shot_noise_hz (1 - 0.75 q)` in all.

    In `fixed` mode the robust crossing rule holds with the leak as part of the signal; pixels start
    at random phases of their leak; shot noise is a Poisson process whose events make the pixel
    forget pending contrast; black counts as grey level 1, as it lies 10 natural-log units below
    otherwise and its flicker would drown the scene. In `faithful` mode the official rule holds, so
    that a leak never fires by itself and blocks ON events in time; shot noise comes with the frame,
    is divided by the largest number of levels any pixel passed plus one, moves the memory by a
    threshold, and is absent from frames in which nothing fires. Logarithm and thresholds are
    float32 there.

    Args:
        threshold_on_log: mean contrast of an ON event, natural-log units.
        threshold_off_log: mean contrast of an OFF event, as a positive number.
        threshold_sigma_log: standard deviation of both across pixels.
        cutoff_hz: bandwidth of each filter at full brightness; 0 removes them.
        leak_hz: ON events per second of a pixel in constant light.
        shot_noise_hz: noise events per second, ON and OFF together, of a dark pixel.
        refractory_us: a pixel drops crossings for so long after an event; the contrast is lost.
        log_offset: added to the intensity, which runs from 0 to 1, before the logarithm.
        seed: of mismatch and noise.

    Raises:
        ValueError: a threshold or the offset is not positive, or another value is negative.

    Example:
        >>> frames = np.array([np.full((1, 1), level) for level in (64.0, 128.0)])
        >>> ideal = Prophesee(threshold_on_log=0.2, threshold_sigma_log=0, shot_noise_hz=0)
        >>> ideal.simulate(frames, [0, 70_000]).t.tolist()
        [20197, 40395, 60593]
    """

    name: ClassVar[str] = "prophesee"

    threshold_on_log: float = 0.15
    threshold_off_log: float = 0.1
    threshold_sigma_log: float = 0.001
    cutoff_hz: float = 0.0
    leak_hz: float = 0.0
    shot_noise_hz: float = 10.0
    refractory_us: float = 1.0
    log_offset: float = 1e-7
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the parameters."""
        super().__post_init__()
        require_positive(self, "threshold_on_log", "threshold_off_log", "log_offset")
        require_not_negative(
            self, "threshold_sigma_log", "cutoff_hz", "leak_hz", "shot_noise_hz", "refractory_us"
        )

    @property
    def stochastic(self) -> bool:
        """Mismatch, shot noise and, in `fixed` mode, the phase of the leak are random."""
        phases = self.leak_hz > 0 and self.mode == "fixed"
        return self.threshold_sigma_log > 0 or self.shot_noise_hz > 0 or phases

    def signal(self, levels: NDArray[np.float64]) -> NDArray[Any]:
        """The log intensity of grey levels 0..255."""
        if self.mode == "faithful":
            return log_intensity(levels.astype(np.float32), self.log_offset)
        return log_intensity(np.maximum(levels, 1.0), self.log_offset)

    def begin(self, image: GreyImage, sequence: str) -> PropheseePixels:
        """The pixels after the first frame."""
        kind = FaithfulPropheseePixels if self.mode == "faithful" else PropheseePixels
        return kind(self, image, sequence)


class PropheseePixels:
    """Filters and mismatch of all pixels, and how far each is above its memory."""

    def __init__(self, model: Prophesee, image: GreyImage, sequence: str) -> None:
        """Settle on the first image."""
        self.model = model
        self.sequence = sequence
        self.first_filter = model.signal(image.levels)[image.codes]
        self.second_filter = self.first_filter.copy()
        self.on: NDArray[Any] = self._thresholds(model.threshold_on_log, "threshold on")
        self.off: NDArray[Any] = self._thresholds(model.threshold_off_log, "threshold off")
        self.last_us = np.full(image.codes.size, -np.inf)
        self.keys = np.empty(image.codes.size, np.int64)
        self._begin()

    def _thresholds(self, mean_log: float, name: str) -> NDArray[np.float64]:
        model, pixels = self.model, self.first_filter.size
        drawn = threshold_map(mean_log, model.threshold_sigma_log, model.seed, name, pixels)
        return np.minimum(drawn, LARGEST_THRESHOLD_LOG) if model.threshold_sigma_log else drawn

    def _begin(self) -> None:
        """Place each pixel somewhere on its way to a leak event."""
        pixels = self.on.size
        self.above, self.moved = np.zeros(pixels), np.zeros(pixels)
        self.chosen = np.empty(pixels + 1, np.int32)
        self.passed = np.empty(pixels + 1, np.int64)
        if self.model.leak_hz > 0:
            key = draw_key(self.model.seed, "leak phase", self.sequence)
            self.above = self.on * uniform_map(key, pixels)

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
            self.above,
            self.moved,
            self.on,
            model.leak_hz * interval.span_us * MICROSECONDS,
        )
        chosen, total = firing_pixels(self.moved, self.on, self.off, self.chosen, self.passed)
        keys = with_room(self.keys, total)
        count = fire_levels(
            self.chosen[:chosen],
            self.passed,
            self.above,
            self.moved,
            self.last_us,
            self.on,
            self.off,
            float(model.refractory_us),
            False,
            interval.start_us,
            interval.span_us,
            keys,
        )
        self.above, self.moved = self.moved, self.above
        if model.shot_noise_hz == 0:
            return keys, count
        return scatter_noise(
            image.codes,
            shot,
            self.above,
            self.on,
            self.off,
            (model.threshold_on_log, model.threshold_off_log),
            draw_key(model.seed, "shot noise", self.sequence, str(interval.frame)),
            interval.start_us,
            interval.span_us,
            keys,
            count,
        )


class FaithfulPropheseePixels(PropheseePixels):
    """The published program's pixels: official rule, noise at the frames."""

    def _begin(self) -> None:
        self.on, self.off = self.on.astype(np.float32), self.off.astype(np.float32)
        self.reference = self.first_filter.astype(np.float64)

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
