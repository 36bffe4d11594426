"""A photoreceptor whose time constant shrinks with the light, in light whose logarithm is a line.

Two first-order laws, of the log light `u = u0 + g s` and the rate `W` per unit of light:

* small signal: `y' = W exp(u) (u - y)`, a filter whose corner follows the light;
* large signal: `y' = W (exp(u) - exp(y))`, a photodiode's capacitance charged by its current. It is
  linear in `w = exp(-y)`, which follows `exp(-u)` as above: quick to brighten, slow to darken.

Both are followed in sub-steps short enough for one time constant each, that of the light in their
middle. Within one the target, `u` or `exp(-u)`, is a line, not held: a settled pixel then is where
it should be at the end, and crossings have closed forms.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from eqs.kernels import njit
from eqs.simulators.pixel.ramp_response import response

STEP_LOG = 0.15  # of the light within a sub-step: the response is then right to 0.005
MOST_STEPS = 64


class Approach(NamedTuple):
    """How a first-order filter goes on: where it is, its target's line, its time constant.

    Where `inverse`, all are of `w = exp(-y)`, which falls as the response rises.
    """

    level: float
    target: float
    slope: float
    tau_us: float
    inverse: bool


@njit(cache=True)
def sub_steps(change_log: float) -> int:
    """How many sub-steps a change of the log light takes.

    Example:
        >>> sub_steps(0.0), sub_steps(-0.4), sub_steps(99.0)
        (1, 3, 64)
    """
    return int(min(max(1.0, math.ceil(abs(change_log) / STEP_LOG)), MOST_STEPS))


@njit(cache=True)
def shrinkage(slope: float, step_us: float) -> float:
    """By how much the time constant shrinks in half a sub-step."""
    return math.exp(-0.5 * slope * step_us)


@njit(cache=True)
def approach(
    level: float,
    light: float,
    slope: float,
    tau_us: float,
    shrink: float,
    step_us: float,
    rate: float,
    large: bool,
) -> Approach:
    """The filter in a sub-step.

    Args:
        level: the response when it begins.
        light: the log light then.
        slope: of the log light, per microsecond.
        tau_us: the time constant then.
        shrink: of it in half a sub-step, see `shrinkage`.
        step_us: length of the sub-step.
        rate: inverse time constant at a log light of 0, per microsecond.
        large: by the large-signal law.
    """
    middle_us = tau_us * shrink
    if not large:
        return Approach(level, light, slope, middle_us, False)
    first = tau_us * rate  # exp(-light)
    last = middle_us * shrink * rate
    return Approach(math.exp(-level), first, (last - first) / step_us, middle_us, True)


@njit(cache=True)
def level_after(way: Approach, wait_us: float) -> float:
    """The response after a wait."""
    reached = response(way.level, way.target, way.slope, way.tau_us, wait_us)
    return -math.log(reached) if way.inverse else reached
