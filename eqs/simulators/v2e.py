"""V2E: a pixel with finite bandwidth, mismatch, leak, shot noise and refractory period.

Hu, Liu and Delbruck, "v2e: From Video Frames to Realistic DVS Events", CVPR Workshops 2021.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numba import njit
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.simulators.base import Interval, Simulator, require_not_negative, require_positive
from eqs.simulators.crossing import crossing_share, levels_passed
from eqs.simulators.ordering import Fired, event_key, with_room
from eqs.simulators.randomness import (
    NORMAL_QUANTILES,
    draw_key,
    normal,
    normal_map,
    normal_quantile,
    poisson,
    uniform,
    uniform_map,
    word_at,
)
from eqs.simulators.thresholds import threshold_map

MICROSECONDS = 1e-6


@dataclass(frozen=True, kw_only=True)
class V2E(Simulator):
    """The published pixel: lin-log photoreceptor, low-pass, leaking memory, shot noise.

    Each frame moves the filtered log intensity `f` by `epsilon (u - f)`, where `u` is the lin-log
    of the grey level and `epsilon = min(1, q 2 pi cutoff dt)` grows with the light,
    `q = (I + 20) / 275`. The memory leaks towards ON events, at `leak_hz` in the mean. Events
    carry the memory to the last level passed. Shot noise fires both polarities at
    `shot_noise_hz (1 - 0.75 q)` in all and makes the pixel forget pending contrast. At video rates
    the filter is inert: 300 Hz filters nothing that is sampled at 20 Hz.

    In `fixed` mode events come when the signal, linear within the interval, crosses its level; the
    refractory period holds at any frame rate and delays an event until it ends; pixels start at
    random phases of their leak; shot noise is a Poisson process with times of its own. In
    `faithful` mode all pixels share a grid of times set by the busiest, the refractory period
    matters only where that grid is finer, pixels leak in step and shot noise comes with the frame.

    Args:
        threshold_on_log: mean contrast of an ON event, natural-log units.
        threshold_off_log: mean contrast of an OFF event, as a positive number.
        threshold_sigma_log: standard deviation of both across pixels; none falls below 0.01.
        cutoff_hz: bandwidth at full brightness; 0 removes the filter.
        leak_hz: ON events per second of a pixel in constant light.
        leak_jitter: standard deviation of the leak from frame to frame, as a share of it.
        leak_spread_decades: standard deviation across pixels of the leak's decimal logarithm.
        shot_noise_hz: noise events per second, ON and OFF together, of a dark pixel.
        refractory_us: a pixel waits so long after an event; the contrast is kept.
        knee_level: grey level, 0..255, below which the photoreceptor is linear.
        seed: of mismatch and noise.

    Raises:
        ValueError: a threshold is not positive, the knee is below 1, or another value is negative.

    Example:
        >>> frames = np.array([np.full((1, 1), level) for level in (64.0, 128.0)])
        >>> ideal = V2E(threshold_sigma_log=0, cutoff_hz=0, leak_hz=0, shot_noise_hz=0)
        >>> ideal.simulate(frames, [0, 70_000]).t.tolist()
        [20197, 40395, 60593]
    """

    name: ClassVar[str] = "v2e"

    threshold_on_log: float = 0.2
    threshold_off_log: float = 0.2
    threshold_sigma_log: float = 0.03
    cutoff_hz: float = 300.0
    leak_hz: float = 0.01
    leak_jitter: float = 0.1
    leak_spread_decades: float = 0.1
    shot_noise_hz: float = 0.001
    refractory_us: float = 500.0
    knee_level: float = 20.0
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the parameters."""
        super().__post_init__()
        require_positive(self, "threshold_on_log", "threshold_off_log")
        require_not_negative(
            self,
            "threshold_sigma_log",
            "cutoff_hz",
            "leak_hz",
            "leak_jitter",
            "leak_spread_decades",
            "shot_noise_hz",
            "refractory_us",
        )
        if not 1 < self.knee_level <= 255:
            raise ValueError(
                f"Expected knee_level above 1 and up to 255, got {self.knee_level}; "
                "set sim.knee_level"
            )

    @property
    def stochastic(self) -> bool:
        """Mismatch, leak and shot noise are random."""
        return self.threshold_sigma_log > 0 or self.leak_hz > 0 or self.shot_noise_hz > 0

    def begin(self, image: GreyImage, sequence: str) -> V2EPixels:
        """The pixels after the first frame."""
        kind = FaithfulV2EPixels if self.mode == "faithful" else V2EPixels
        return kind(self, image, sequence)

    def filter_share(self, levels: NDArray[np.float64], span_us: int) -> NDArray[np.float64]:
        """Share of the way to the new signal that the filter goes within the interval."""
        if self.cutoff_hz == 0:
            return np.ones_like(levels)
        turns = 2 * math.pi * self.cutoff_hz * span_us * MICROSECONDS
        return np.minimum(1.0, relative_light(levels) * turns)

    def shot_events(self, levels: NDArray[np.float64], span_us: int) -> NDArray[np.float64]:
        """Expected shot-noise events of one polarity within the interval."""
        full = 0.5 * self.shot_noise_hz * span_us * MICROSECONDS
        return full * (1.0 - 0.75 * relative_light(levels))


def lin_log(levels: NDArray[np.float64], knee_level: float = 20.0) -> NDArray[np.float64]:
    """Natural log of the grey level, and a line to the origin below the knee.

    Rounded to 8 decimals, so that equal steps up and down cancel.

    Example:
        >>> lin_log(np.array([0.0, 10.0, 20.0, 200.0])).round(3).tolist()
        [0.0, 1.498, 2.996, 5.298]
    """
    slope = math.log(knee_level) / knee_level
    logarithm = np.log(np.maximum(levels, knee_level))
    signal: NDArray[np.float64] = np.where(levels <= knee_level, levels * slope, logarithm)
    return np.round(signal, 8)


def relative_light(levels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Light as a share of full light, with the published program's floor of 20 grey levels."""
    return (levels + 20.0) / 275.0


class V2EPixels:
    """Filter, memory, mismatch and leak of all pixels."""

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
        self.memory = self.filtered - self._initial_phase(on)
        self.last_us = np.full(pixels, -np.inf)
        self.keys = np.empty(pixels, np.int64)

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

    def _initial_phase(self, on: NDArray[np.float64]) -> NDArray[Any]:
        """How far each pixel already is on its way to a leak event."""
        if self.model.leak_hz == 0:
            return np.zeros(1)
        key = draw_key(self.model.seed, "leak phase", self.sequence)
        return on * uniform_map(key, on.size)

    def advance(self, image: GreyImage, interval: Interval) -> NDArray[np.int64]:
        """Events of one interval."""
        model = self.model
        signal = lin_log(image.levels, model.knee_level).astype(self.precision)
        share = model.filter_share(image.levels, interval.span_us).astype(self.precision)
        shot = model.shot_events(image.levels, interval.span_us)
        self.keys, count = self._fire(image, signal, share, shot, interval)
        return self.keys[:count]

    def _fire(
        self,
        image: GreyImage,
        signal: NDArray[Any],
        share: NDArray[Any],
        shot: NDArray[np.float64],
        interval: Interval,
    ) -> Fired:
        model = self.model
        return _fire_continuously(
            image.codes,
            signal,
            share,
            shot,
            self.filtered,
            self.memory,
            self.last_us,
            self.on,
            self.off,
            self.leak_per_second,
            (model.threshold_on_log, model.threshold_off_log),
            (model.leak_jitter if model.leak_hz else 0.0, model.shot_noise_hz > 0),
            draw_key(model.seed, "noise", self.sequence, str(interval.frame)),
            NORMAL_QUANTILES,
            float(model.refractory_us),
            interval.start_us,
            interval.span_us,
            self.keys,
        )


@njit(cache=True, nogil=True)
def _fire_continuously(
    codes: NDArray[Any],
    signal: NDArray[np.float64],
    share: NDArray[np.float64],
    shot: NDArray[np.float64],
    filtered: NDArray[np.float64],
    memory: NDArray[np.float64],
    last_us: NDArray[np.float64],
    on: NDArray[np.float64],
    off: NDArray[np.float64],
    leak_per_second: NDArray[np.float64],
    nominal: tuple[float, float],
    noise: tuple[float, bool],
    frame_key: np.uint64,
    quantiles: NDArray[np.float64],
    refractory_us: float,
    start_us: int,
    span_us: int,
    keys: NDArray[np.int64],
) -> Fired:
    leak_jitter, has_shot = noise
    has_noise = has_shot or leak_jitter > 0
    seconds = span_us * MICROSECONDS
    word = frame_key
    count = 0
    for pixel in range(codes.size):
        code = codes[pixel]
        before, weight = filtered[pixel], share[code]
        after = (1.0 - weight) * before + weight * signal[code]
        filtered[pixel] = after
        leak = leak_per_second[pixel] * seconds
        if has_noise:
            word = word_at(frame_key, pixel)
            leak *= 1.0 - leak_jitter * normal_quantile(word, quantiles)
        first, last = before - memory[pixel], after - memory[pixel] + leak
        memory[pixel] -= leak
        passed = levels_passed(last, on[pixel], off[pixel])
        if passed != 0:
            keys = with_room(keys, count + abs(passed))
            step = on[pixel] if passed > 0 else -off[pixel]
            polarity = 1 if passed > 0 else 0
            for ordinal in range(1, abs(passed) + 1):
                offset_us = crossing_share(ordinal * step, first, last) * span_us
                # A crossing within the refractory period fires when that ends, as the signal of
                # the interval is still beyond the level then.
                offset_us = max(offset_us, last_us[pixel] + refractory_us - start_us)
                if offset_us > span_us:
                    break
                last_us[pixel] = start_us + offset_us
                memory[pixel] += step
                keys[count] = event_key(start_us + int(offset_us), pixel, polarity)
                count += 1
        if has_shot:
            expected_on = shot[code] * nominal[0] / on[pixel]
            expected_off = shot[code] * nominal[1] / off[pixel]
            number = poisson(word, expected_on + expected_off)
            if number > 0:
                keys = with_room(keys, count + number)
                memory[pixel] = after
                on_share = expected_on / (expected_on + expected_off)
                for ordinal in range(number):
                    draw = word_at(word, 2 * ordinal)
                    polarity = 1 if uniform(word_at(word, 2 * ordinal + 1)) < on_share else 0
                    time_us = start_us + int(uniform(draw) * span_us)
                    keys[count] = event_key(time_us, pixel, polarity)
                    count += 1
    return keys, count


class FaithfulV2EPixels(V2EPixels):
    """The published program's pixels, in its float32."""

    precision: ClassVar[Any] = np.float32

    def _initial_phase(self, on: NDArray[np.float64]) -> NDArray[Any]:
        return np.zeros(1, np.float32)

    def _fire(
        self,
        image: GreyImage,
        signal: NDArray[Any],
        share: NDArray[Any],
        shot: NDArray[np.float64],
        interval: Interval,
    ) -> Fired:
        model = self.model
        frame = str(interval.frame)
        passed = _count_levels(
            image.codes,
            signal,
            share,
            self.filtered,
            self.memory,
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
            self.memory,
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
            image.codes,
            shot,
            self.filtered,
            self.memory,
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
