"""Events of a filtered pixel where its signal crosses thresholds."""

from __future__ import annotations

import math

import numpy as np

from eqs.kernels import njit
from eqs.simulators.pixel.filtered.circuit import (
    SEEING,
    Circuit,
    Comparator,
    Pixel,
    Ramp,
    cannot_fire,
    moved,
    rest_of,
    step_of,
    sub_step,
)
from eqs.simulators.pixel.light_dependent import Approach, shrinkage, sub_steps
from eqs.simulators.pixel.ramp_response import first_crossing, response
from eqs.simulators.pixel.randomness import word_at, ziggurat_normal
from eqs.simulators.streaming.keys import Keys, event_key, with_room

_LONGEST_BLUR = 3.0  # time constants by which noise delays an event at most


@njit(cache=True)
def _plain(way: Approach, level: float) -> float:
    """The response that a level of its approach stands for."""
    return -math.log(level) if way.inverse else level


@njit(cache=True)
def _next_crossing(
    way: Approach, level: float, now_us: float, limit_us: float, bounds: tuple[float, float]
) -> tuple[float, bool]:
    """Time until a response leaves two bounds, none where it has, and whether upwards."""
    low, high = bounds
    if way.inverse:
        low, high = math.exp(-bounds[1]), math.exp(-bounds[0])
    if level >= high or level <= low:
        return 0.0, (level >= high) != way.inverse
    target = way.target + way.slope * now_us
    wait_us, up = first_crossing(level, target, way.slope, way.tau_us, limit_us, (low, high))
    return wait_us, up != way.inverse


@njit(cache=True)
def _blur_us(
    way: Approach, level: float, now_us: float, comparator: Comparator, word: np.uint64
) -> float:
    """How much earlier or later noise lets a signal pass a threshold: its spread over the slope."""
    if comparator.noise_log == 0.0:
        return 0.0
    speed = (way.target + way.slope * now_us - level) / way.tau_us
    if way.inverse:
        speed /= level
    slowest = comparator.noise_log / comparator.noise_us
    blur_us = comparator.noise_log / max(abs(speed), slowest) * ziggurat_normal(word)
    return min(blur_us, _LONGEST_BLUR * comparator.noise_us)


@njit(cache=True)
def _fire_step(
    way: Approach,
    pixel: Pixel,
    comparator: Comparator,
    circuit: Circuit,
    span: tuple[float, float],
    draws: tuple[np.uint64, int],
    index: int,
    keys: Keys,
    count: int,
) -> tuple[Pixel, Keys, int]:
    """Events of a pixel in one sub-step, through which its filter goes as `way` says."""
    begin_us, step_us = span
    level, now_us = way.level, 0.0
    memory, ready_us, last_us = pixel.memory, pixel.ready_us, pixel.last_us
    while ready_us < begin_us + step_us:
        if ready_us != SEEING:
            wait_us = max(ready_us - begin_us - now_us, 0.0)
            target = way.target + way.slope * now_us
            level = response(level, target, way.slope, way.tau_us, wait_us)
            now_us, ready_us = now_us + wait_us, SEEING
            if circuit.resets:
                memory = _plain(way, level)
        bounds = memory - comparator.off, memory + comparator.on
        wait_us, up = _next_crossing(way, level, now_us, step_us - now_us, bounds)
        if wait_us > step_us - now_us:
            break
        if wait_us > 0.0:
            level = bounds[1] if up else bounds[0]
            level = math.exp(-level) if way.inverse else level
        now_us += wait_us
        word = word_at(draws[0], count - draws[1])
        event_us = begin_us + now_us + _blur_us(way, level, now_us, comparator, word)
        last_us = max(event_us, last_us)
        keys = with_room(keys, count + 1)
        keys[count] = event_key(int(last_us), index, 1 if up else 0)
        count += 1
        memory = bounds[1] if up else bounds[0]
        ready_us = last_us + circuit.refractory_us
    return Pixel(pixel.received, pixel.filtered, memory, ready_us, last_us), keys, count


@njit(cache=True)
def fire_signal(
    pixel: Pixel,
    ramp: Ramp,
    comparator: Comparator,
    circuit: Circuit,
    span: tuple[float, float],
    key: np.uint64,
    index: int,
    keys: Keys,
    count: int,
) -> tuple[Pixel, Keys, int]:
    """Events within an interval of the pixel number `index`, and that pixel at the end of it."""
    start_us, stop_us = span
    draws = key, count  # of this pixel's events, whatever others fire
    left_us = stop_us - start_us
    longest_us = left_us / sub_steps(ramp.slope * left_us)
    # No event may come before the interval.
    pixel = Pixel(
        pixel.received, pixel.filtered, pixel.memory, pixel.ready_us, max(pixel.last_us, start_us)
    )
    while left_us > 0.0:
        step_us = step_of(pixel, ramp, longest_us, left_us, circuit)
        shrink = shrinkage(ramp.slope, step_us)
        way, reached = sub_step(pixel, ramp, shrink, step_us, circuit)
        if pixel.ready_us != SEEING or not cannot_fire(pixel, ramp, step_us, comparator):
            step = stop_us - left_us, step_us
            pixel, keys, count = _fire_step(
                way, pixel, comparator, circuit, step, draws, index, keys, count
            )
        pixel = moved(pixel, way, reached, ramp.leak, step_us, circuit)
        ramp = rest_of(ramp, shrink, step_us)
        left_us -= step_us
    return pixel, keys, count
