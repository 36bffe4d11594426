"""What filtered pixels see, what they share, what they hold, and how their filters go on."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eqs.kernels import njit
from eqs.simulators.pixel.light_dependent import (
    Approach,
    approach,
    level_after,
    shrinkage,
    sub_steps,
)

SEEING = -math.inf
"""The end of the blindness of a pixel that is not blind."""
_TRANSIENT_LOG = 0.01  # below it a transient is over
_TRANSIENT_STEP = 0.25  # time constants; a line then is right to a hundredth of the transient


class Seen(NamedTuple):
    """An image as pixels see it; all but the codes by grey level.

    Args:
        codes: grey level of each pixel, as an index into what follows.
        light_log: log light.
        tau_us: time constant of the photoreceptor.
        noise_log: standard deviation of the filtered signal, natural-log units.
        noise_us: correlation time of that noise.
        leak: how fast the memory leaks, log units per microsecond; it takes a pole.
    """

    codes: NDArray[Any]
    light_log: NDArray[np.float64]
    tau_us: NDArray[np.float64]
    noise_log: NDArray[np.float64]
    noise_us: NDArray[np.float64]
    leak: NDArray[np.float64]


class Circuit(NamedTuple):
    """What all pixels share.

    Args:
        rate: inverse time constant of the photoreceptor at a log light of 0, per microsecond.
        large: whether it goes by the large-signal law.
        pole_us: time constant of the pole behind it, 0 for none.
        refractory_us: after an event a pixel is blind for so long.
        resets: whether its memory then takes the signal; else it has moved by the threshold, and
            what was crossed in the meantime fires.
    """

    rate: float
    large: bool
    pole_us: float
    refractory_us: float
    resets: bool


class Pixel(NamedTuple):
    """What one pixel holds.

    Args:
        received: the photoreceptor's response.
        filtered: that of the pole behind it, or the same.
        memory: with what the comparator compares it.
        ready_us: end of its blindness, or SEEING.
        last_us: time of its last event.
    """

    received: float
    filtered: float
    memory: float
    ready_us: float
    last_us: float


class Ramp(NamedTuple):
    """What one pixel sees in an interval, or in what is left of it.

    Args:
        start: log light when it begins.
        slope: of the log light, per microsecond.
        tau_us: time constant of the light when it begins.
        leak: of the memory, log units per microsecond.
    """

    start: float
    slope: float
    tau_us: float
    leak: float


class Comparator(NamedTuple):
    """Thresholds and noise of one pixel."""

    on: float
    off: float
    noise_log: float
    noise_us: float


@njit(cache=True)
def step_of(pixel: Pixel, ramp: Ramp, longest_us: float, left_us: float, circuit: Circuit) -> float:
    """Length of the next sub-step, the last of which ends with the interval.

    Args:
        pixel: when it begins.
        ramp: what is left of the interval's.
        longest_us: in which the light changes little enough.
        left_us: of the interval.
        circuit: its filters.
    """
    # A pole behind takes the photoreceptor's way for a line, so its transients go in finer steps.
    if circuit.pole_us > 0.0:
        above = pixel.received - ramp.start
        if abs(above + ramp.slope * ramp.tau_us) > _TRANSIENT_LOG:
            quick = circuit.large and above > 0.0  # what is too bright falls at its own rate
            tau_us = ramp.tau_us * (math.exp(-above) if quick else 1.0)
            longest_us = min(longest_us, _TRANSIENT_STEP * tau_us)
    return left_us if left_us < 1.5 * longest_us else longest_us


@njit(cache=True)
def sub_step(
    pixel: Pixel, ramp: Ramp, shrink: float, step_us: float, circuit: Circuit
) -> tuple[Approach, float]:
    """What the comparator sees in a sub-step, leak included; and the photoreceptor's end."""
    way = approach(
        pixel.received, ramp.start, ramp.slope, ramp.tau_us, shrink, step_us, circuit.rate,
        circuit.large,
    )  # fmt: skip
    reached = level_after(way, step_us)
    tau_us = circuit.pole_us
    if tau_us > 0.0:
        slope = (reached - pixel.received) / step_us + ramp.leak
        target = pixel.received + ramp.leak * tau_us
        way = Approach(pixel.filtered, target, slope, tau_us, False)
    return way, reached


@njit(cache=True)
def rest_of(ramp: Ramp, shrink: float, step_us: float) -> Ramp:
    """The ramp after a sub-step."""
    start = ramp.start + ramp.slope * step_us
    return Ramp(start, ramp.slope, ramp.tau_us * shrink * shrink, ramp.leak)


@njit(cache=True)
def moved(
    pixel: Pixel, way: Approach, reached: float, leak: float, step_us: float, circuit: Circuit
) -> Pixel:
    """A pixel's filters and memory after a sub-step."""
    leaked = leak * step_us
    filtered = level_after(way, step_us) - leaked if circuit.pole_us > 0.0 else reached
    return Pixel(reached, filtered, pixel.memory - leaked, pixel.ready_us, pixel.last_us)


@njit(cache=True)
def cannot_fire(pixel: Pixel, ramp: Ramp, span_us: float, comparator: Comparator) -> bool:
    """Whether a signal stays within its thresholds.

    Filters stay between where they are and where the light goes.
    """
    last = ramp.start + ramp.slope * span_us
    lowest = min(pixel.received, pixel.filtered, ramp.start, last)
    highest = max(pixel.received, pixel.filtered, ramp.start, last) + ramp.leak * span_us
    inside = lowest > pixel.memory - comparator.off
    return inside and highest < pixel.memory + comparator.on


@njit(cache=True)
def settled(pixel: Pixel, ramp: Ramp, span_us: float, circuit: Circuit) -> Pixel:
    """A pixel that fires nothing, at the end of a span."""
    longest_us, left_us = span_us / sub_steps(ramp.slope * span_us), span_us
    while left_us > 0.0:
        step_us = step_of(pixel, ramp, longest_us, left_us, circuit)
        shrink = shrinkage(ramp.slope, step_us)
        way, reached = sub_step(pixel, ramp, shrink, step_us, circuit)
        pixel = moved(pixel, way, reached, ramp.leak, step_us, circuit)
        ramp = rest_of(ramp, shrink, step_us)
        left_us -= step_us
    return Pixel(pixel.received, pixel.filtered, pixel.memory, SEEING, pixel.last_us)
