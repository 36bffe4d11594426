"""Events of a filtered pixel whose signal stands still."""

from __future__ import annotations

import math

import numpy as np

from eqs.kernels import njit
from eqs.simulators.pixel.filtered.circuit import SEEING, Circuit, Comparator, Pixel
from eqs.simulators.pixel.first_passage import FARTHEST, passage_rate
from eqs.simulators.pixel.randomness import uniform, word_at
from eqs.simulators.streaming.keys import Keys, event_key, with_room


@njit(cache=True)
def may_fire(pixel: Pixel, comparator: Comparator) -> bool:
    """Whether a threshold is near enough for noise; spares most pixels the rest."""
    above = pixel.filtered - pixel.memory
    nearest = min(comparator.on - above, comparator.off + above)
    return nearest < FARTHEST * comparator.noise_log


@njit(cache=True)
def _wait(
    pixel: Pixel, comparator: Comparator, left_us: float, word: np.uint64
) -> tuple[float, bool]:
    """Time until noise fires a pixel, more than is left if not at all, and whether ON."""
    above = pixel.filtered - pixel.memory
    rate_on = passage_rate((comparator.on - above) / comparator.noise_log) / comparator.noise_us
    rate_off = passage_rate((comparator.off + above) / comparator.noise_log) / comparator.noise_us
    rate = rate_on + rate_off
    share = uniform(word_at(word, 0))
    if share >= rate * left_us:  # -ln(1 - u) >= u spares the logarithm nearly always
        return math.inf, False
    return -math.log(1.0 - share) / rate, uniform(word_at(word, 1)) * rate < rate_on


@njit(cache=True)
def fire_noise(
    pixel: Pixel,
    comparator: Comparator,
    circuit: Circuit,
    span: tuple[float, float],
    key: np.uint64,
    index: int,
    keys: Keys,
    count: int,
) -> tuple[Pixel, Keys, int]:
    """Noise events of a pixel that the signal does not fire; each resets it to the signal."""
    now_us, stop_us = span
    ready_us, ordinal = SEEING, 0
    while now_us < stop_us:
        word = word_at(key, ordinal)
        wait_us, up = _wait(pixel, comparator, stop_us - now_us, word)
        now_us += wait_us
        if now_us >= stop_us:
            break
        keys = with_room(keys, count + 1)
        keys[count] = event_key(int(now_us), index, 1 if up else 0)
        count, ordinal = count + 1, ordinal + 1
        ready_us = now_us + circuit.refractory_us
        pixel = Pixel(pixel.received, pixel.filtered, pixel.filtered, ready_us, now_us)
        now_us = ready_us
    return pixel, keys, count
