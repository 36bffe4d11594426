"""How a first-order filter follows a signal that is linear in time, and where it crosses a level.

With a signal `u + g s` and a time constant `tau` the response from `y` is
`u + g (s - tau) + (y - u + g tau) exp(-s / tau)`, which has at most one extremum.
"""

from __future__ import annotations

import math

from eqs.kernels import njit

_ACCURACY_US = 1e-4
_MOST_STEPS = 100
_FORGOTTEN = 40.0  # time constants after which less than the last bit is left of a start


@njit(cache=True)
def response(level: float, light: float, slope: float, tau_us: float, wait_us: float) -> float:
    """The response after a wait.

    Args:
        level: the response now.
        light: the signal now.
        slope: of the signal, per microsecond.
        tau_us: time constant.
        wait_us: how long to wait.

    Example:
        >>> round(response(0.0, 1.0, 0.0, 50.0, 50.0), 4), response(1.0, 1.0, 0.0, 50.0, 9.0)
        (0.6321, 1.0)
    """
    lag = slope * tau_us
    return light + slope * wait_us - lag + (level - light + lag) * _left(wait_us, tau_us)


@njit(cache=True)
def _left(wait_us: float, tau_us: float) -> float:
    """Share of a start that is left after a wait; a comparison spares most exponentials."""
    return math.exp(-wait_us / tau_us) if wait_us < _FORGOTTEN * tau_us else 0.0


@njit(cache=True)
def first_crossing(
    level: float,
    light: float,
    slope: float,
    tau_us: float,
    limit_us: float,
    bounds: tuple[float, float],
) -> tuple[float, bool]:
    """When the response first leaves the range between two bounds, and whether upwards.

    Args:
        level: the response now, between the bounds.
        light: the signal now.
        slope: of the signal, per microsecond.
        tau_us: time constant.
        limit_us: how far to look.
        bounds: the lower and the upper bound.

    Returns:
        The wait, infinite if there is no crossing up to the limit; and whether it leads up.

    Example:
        >>> wait, up = first_crossing(0.0, 1.0, 0.0, 50.0, 1000.0, (-0.5, 0.5))
        >>> round(wait, 2), up
        (34.66, True)
    """
    # The response stays between where it is and where the light goes.
    last = light + slope * limit_us
    if min(level, light, last) > bounds[0] and max(level, light, last) < bounds[1]:
        return math.inf, False
    lag = slope * tau_us
    offset = level - light + lag
    # The response turns round where its two parts balance, if that lies ahead.
    turn_us = limit_us
    if offset * lag > 0.0 and abs(offset) > abs(lag):
        turn_us = min(tau_us * math.log(offset / lag), limit_us)
    before_us = 0.0
    for stop_us in (turn_us, limit_us):
        reached = response(level, light, slope, tau_us, stop_us)
        if reached >= bounds[1] or reached <= bounds[0]:
            up = reached >= bounds[1]
            bound = bounds[1] if up else bounds[0]
            return _root(level, light, slope, tau_us, before_us, stop_us, bound, up), up
        before_us = stop_us
    return math.inf, False


@njit(cache=True)
def _root(
    level: float,
    light: float,
    slope: float,
    tau_us: float,
    low_us: float,
    high_us: float,
    bound: float,
    up: bool,
) -> float:
    """Where the response, monotonic from `low_us` to `high_us`, reaches a bound.

    Newton's steps, from where the response would be had it forgotten its start, and halvings where
    a step leaves the range that is left.
    """
    lag = slope * tau_us
    offset = level - light + lag
    wait_us = (bound - light + lag) / slope if slope != 0.0 else low_us
    for _ in range(_MOST_STEPS):
        if not low_us <= wait_us <= high_us:
            wait_us = 0.5 * (low_us + high_us)
        decayed = offset * _left(wait_us, tau_us)
        missing = bound - (light + slope * wait_us - lag + decayed)
        if (missing <= 0.0) if up else (missing >= 0.0):
            high_us = wait_us
        else:
            low_us = wait_us
        speed = slope - decayed / tau_us
        step_us = missing / speed if speed != 0.0 else math.inf
        wait_us += step_us
        if abs(step_us) <= _ACCURACY_US or high_us - low_us <= _ACCURACY_US:
            break
    return min(max(wait_us, low_us), high_us)
