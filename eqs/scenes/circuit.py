"""Compiled pixel circuit and readout of the reference event camera."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eqs.kernels import njit

Array = NDArray[np.float64]
Picture = NDArray[np.float32]
Line = tuple[float, float, float, float]  # start, slope and leak per us, length of the step in us
Place = tuple[float, float, float]  # start of the step in us, column, row


class Circuit(NamedTuple):
    """Constants of the circuit; currents in fA, `_s_fa` are time constants times current."""

    fa_per_lux: float
    dark_fa: float
    input_s_fa: float
    miller_s_fa: float
    gain: float
    loop_gain: float
    output_s: float
    step_s: float
    noise_fa: float
    refractory_us: float
    latency_us: float
    jitter_us: float
    row_service_us: float
    leak_per_lux: float


@njit(cache=True)
def mix(key: np.uint64, index: np.uint64) -> np.uint64:
    """A random 64-bit number for each (key, index). Source: SplitMix64 (Steele et al. 2014)."""
    z = key + (index + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@njit(cache=True)
def bell(bits: np.uint64) -> float:
    """Nearly normal number of variance one: the sum of four uniform ones, 16 bits each."""
    mask = np.uint64(0xFFFF)
    total = np.int64(bits & mask) + np.int64((bits >> np.uint64(16)) & mask)
    total += np.int64((bits >> np.uint64(32)) & mask) + np.int64(bits >> np.uint64(48))
    return (total - 131070) * (math.sqrt(3.0) / 65536.0)


@njit(cache=True, error_model="numpy")
def _photoreceptor(
    y: float, slope: float, lux: float, circuit: Circuit, noise: float
) -> tuple[float, float]:
    """Output after one step, backward Euler (stable for any bandwidth), and its slope.

    y'' + 2 zeta omega y' + omega^2 y = omega^2 u with u = ln i plus shot noise; times written
    out so that only one division is left. Source: Lichtsteiner et al. 2008 (small signals).
    """
    current = circuit.fa_per_lux * lux + circuit.dark_fa
    inverse = 1.0 / current
    u = math.log(current) + noise * math.sqrt(circuit.noise_fa * inverse)
    both = (circuit.input_s_fa + circuit.miller_s_fa) * inverse
    product = both * circuit.output_s
    damping = both + circuit.gain * circuit.miller_s_fa * inverse + circuit.output_s
    step, loop = circuit.step_s, circuit.loop_gain
    slope = (slope * product + step * loop * (u - y)) / (product + step * (damping + step * loop))
    return y + step * slope, slope


@njit(cache=True, error_model="numpy")
def _fire(
    line: Line,
    memory: float,
    now: float,
    on: float,
    off: float,
    circuit: Circuit,
    draw: np.uint64,
    place: Place,
    events: Array,
    count: int,
) -> tuple[float, float, int]:
    """Find the crossings of one pixel from `now` to the end of the step; memory, time, count."""
    start, rise, leak, step_us = line
    drift = rise + leak
    serial = np.uint64(0)
    while now < step_us:
        ahead = (on if drift > 0.0 else -off) - (start + rise * now - memory)
        wait = max(ahead / drift, 0.0) if drift != 0.0 else step_us
        if now + wait >= step_us:
            return memory - leak * (step_us - now), step_us, count
        now += wait
        if count < len(events):
            delay = circuit.latency_us + circuit.jitter_us * bell(mix(draw, serial))
            events[count, 0] = place[0] + now + max(delay, 0.0)
            events[count, 1], events[count, 2] = place[1], place[2]
            events[count, 3] = 1.0 if drift > 0.0 else 0.0
        count += 1
        serial += np.uint64(1)
        now += circuit.refractory_us
        memory = start + rise * now  # overwritten after a reset that outlasts the step
    return memory, now, count


@njit(cache=True, error_model="numpy")
def advance(
    state: Picture,
    picture: Picture,
    thresholds: Picture,
    leak_per_us: Picture,
    circuit: Circuit,
    key: np.uint64,
    step_index: int,
    width: int,
    events: Array,
) -> int:
    """Advance every pixel by one step and write its events as (request time us, x, y, p) rows.

    Times count from the start of the recording. Returns the number of events, which may exceed
    the room in `events`; the surplus is then not written.
    """
    count, pixels = 0, len(picture)
    step_us = circuit.step_s * 1e6
    for i in range(pixels):
        draw = mix(key, np.uint64(step_index * pixels + i))
        y0 = float(state[0, i])
        y1, slope = _photoreceptor(y0, float(state[1, i]), float(picture[i]), circuit, bell(draw))
        state[0, i], state[1, i] = y1, slope
        memory, now = float(state[2, i]), float(state[3, i])
        if now >= step_us:
            state[3, i] = now - step_us
            continue
        leak = leak_per_us[i] * (1.0 + circuit.leak_per_lux * picture[i])
        rise = (y1 - y0) / step_us
        if now > 0.0:
            memory = y0 + rise * now  # leaving reset, the pixel memorises what it sees then
        on, off = float(thresholds[0, i]), float(thresholds[1, i])
        rest = step_us - now
        change = y0 + rise * now - memory + (rise + leak) * rest
        if -off < change < on:  # by far the most pixels: straight lines cannot cross in between
            state[2, i], state[3, i] = memory - leak * rest, 0.0
            continue
        line = (y0, rise, leak, step_us)
        place = (step_index * step_us, float(i % width), float(i // width))
        memory, now, count = _fire(line, memory, now, on, off, circuit, draw, place, events, count)
        state[2, i], state[3, i] = memory, max(now - step_us, 0.0)
    return count


@njit(cache=True)
def read_out(requests: Array, bus: Array, service_us: float) -> NDArray[np.int64]:
    """Whole-microsecond times at which sorted requests leave the sensor.

    The readout serves one row at a time for `service_us`; requests of that row which are already
    waiting leave together. `bus` holds when it is free and which row it served last.
    """
    times = np.empty(len(requests), np.int64)
    for k in range(len(requests)):
        asked, row = requests[k, 0], requests[k, 2]
        if row != bus[1] or asked > bus[0]:
            bus[0] = max(asked, bus[0] + service_us)
            bus[1] = row
        times[k] = np.int64(math.floor(bus[0]))
    return times
