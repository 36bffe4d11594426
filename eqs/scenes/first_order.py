"""An event camera of another build: one pole, comparator noise, and a clocked scan."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eqs.kernels import njit
from eqs.scenes.circuit import Array, Picture, bell, mix
from eqs.scenes.sensor_stream import EventSensor, SensorStream


@dataclass(frozen=True, kw_only=True)
class FirstOrderSensor(EventSensor):
    r"""An event camera that differs from the reference sensor in every part of its circuit.

    One pole follows the logarithm of the light, with a time constant that a bias sets and dim
    light lengthens. Its noise is the comparator's: as strong in the dark as in the light, and of
    a short memory. Every row is looked at once per scan; a pixel whose signal lies a threshold
    above or below what it memorised then sends one event and moves its memory by that threshold,
    so nothing is lost and much has to wait. Memories leak up in some pixels and down in others,
    at a rate that does not depend on light.

    .. math:: \tau = \tau_0 + \tau_1 / (L + L_0), \qquad v = y + n, \qquad
        \langle n(t) n(t + s) \rangle = \sigma^2 e^{-|s| / \tau_n}

    Args:
        dark_lux: light that causes as much current as the dark.
        bias_time_us: time constant in bright light, us.
        dim_time_us_lux: what dim light adds to it, us times lux.
        noise_log: standard deviation of the comparator's noise, natural-log contrast.
        noise_time_us: its memory, us.
        leak_log_per_s: standard deviation over the array of the drift of a memory per second.
        hot_pixel_fraction: share of the pixels that drift fast.
        hot_pixel_log_per_s: mean drift of those, exponentially distributed, either way.
        scan_us: time from one scan of a row to the next, us; a whole part of `step_us`.

    Source: synchronous row scan and pixel without handshake as in Son et al., ISSCC 2017;
    configs/sensor/first_order.yaml says where every number comes from.
    """

    scales: ClassVar[Mapping[str, Mapping[str, float]]] = {
        "contrast": {"threshold_on_log": 1, "threshold_off_log": 1},
        "balance": {"threshold_on_log": -1, "threshold_off_log": 1},
        "slowness": {"bias_time_us": 1, "dim_time_us_lux": 1},
        "noise": {"noise_log": 1},
        "leak": {"leak_log_per_s": 1},
        "hot_pixels": {"hot_pixel_fraction": 1},
        "mismatch": {"threshold_mismatch_log": 1},
    }

    threshold_on_log: float = 0.18
    threshold_off_log: float = 0.20
    threshold_mismatch_log: float = 0.025
    dark_lux: float = 0.05
    bias_time_us: float = 500.0
    dim_time_us_lux: float = 2000.0
    noise_log: float = 0.035
    noise_time_us: float = 3000.0
    leak_log_per_s: float = 0.05
    hot_pixel_fraction: float = 5e-4
    hot_pixel_log_per_s: float = 6.0
    scan_us: int = 500
    seed: int = 3

    def __post_init__(self) -> None:
        """Refuse values the circuit cannot have."""
        self.require("threshold_on_log", "threshold_off_log", "dark_lux", "bias_time_us")
        self.require("noise_time_us", "scan_us", "step_us")
        if self.step_us % self.scan_us:
            raise ValueError(
                f"Expected whole scans in a step of {self.step_us} us, got scans of "
                f"{self.scan_us} us; set scene.sensor.scan_us"
            )

    def start(
        self, height: int, width: int, *, noise_key: tuple[int, ...], start_us: int = 0
    ) -> FirstOrderStream:
        """Switch the sensor on; `noise_key` names the recording and thereby its noise."""
        return FirstOrderStream(self, height, width, noise_key=noise_key, start_us=start_us)


class FirstOrderStream(SensorStream):
    """One recording of a `FirstOrderSensor`.

    Convention: between two pictures the logarithm of the light and the noise run straight.
    """

    def __init__(
        self,
        sensor: FirstOrderSensor,
        height: int,
        width: int,
        *,
        noise_key: tuple[int, ...],
        start_us: int,
    ) -> None:
        """Draw the sensor's fixed pattern."""
        # A pixel remembers the log light, its output, its noise and the memorised value.
        super().__init__(
            sensor,
            height,
            width,
            rows=4,
            row_service_us=0.0,
            noise_key=noise_key,
            start_us=start_us,
        )
        self._sensor, count, pattern = sensor, height * width, self._pattern
        drift = sensor.leak_log_per_s * pattern.standard_normal(count)
        hot = pattern.random(count) < sensor.hot_pixel_fraction
        sign = np.where(pattern.random(count) < 0.5, -1.0, 1.0)
        drift[hot] += (sign * pattern.exponential(sensor.hot_pixel_log_per_s, count))[hot]
        self._drift = (1e-6 * sensor.step_us * drift).astype(np.float32)
        self._scan = Scan(
            dark_lux=sensor.dark_lux,
            bias_us=sensor.bias_time_us,
            dim_us_lux=sensor.dim_time_us_lux,
            noise_kept=math.exp(-sensor.step_us / sensor.noise_time_us),
            noise_log=sensor.noise_log,
            step_us=float(sensor.step_us),
            scan_us=float(sensor.scan_us),
            height=height,
            width=width,
        )

    def _settle(self, picture: NDArray[np.float32]) -> None:
        rng = np.random.default_rng(self._phase_seed)
        self._state[0] = self._state[1] = np.log(picture + self._sensor.dark_lux)
        self._state[2] = self._sensor.noise_log * rng.standard_normal(len(picture))
        self._state[3] = self._memories(self._state[1], rng)

    def _run(self, picture: NDArray[np.float32], state: NDArray[np.float32], room: Array) -> int:
        return scan_pixels(
            state, picture, self._thresholds, self._drift, self._scan, self._key, self._steps, room
        )


class Scan(NamedTuple):
    """Constants of the circuit and its clock, as the compiled code reads them."""

    dark_lux: float
    bias_us: float
    dim_us_lux: float
    noise_kept: float
    noise_log: float
    step_us: float
    scan_us: float
    height: int
    width: int


@njit(cache=True, error_model="numpy")
def scan_pixels(
    state: Picture,
    picture: Picture,
    thresholds: Picture,
    drift: Picture,
    scan: Scan,
    key: np.uint64,
    step_index: int,
    events: Array,
) -> int:
    """Advance every pixel by one step and write its events as (time us, x, y, p) rows.

    The output of the pole is exact for light whose logarithm runs straight through the step.
    Returns the number of events; those for which `events` has no room are not written.
    """
    count, pixels, step_us = 0, len(picture), scan.step_us
    fresh = scan.noise_log * math.sqrt(1.0 - scan.noise_kept**2)
    for i in range(pixels):
        u0, y0, n0, memory = state[0, i], state[1, i], state[2, i], state[3, i]
        lux = picture[i] + scan.dark_lux
        u1, tau_us = math.log(lux), scan.bias_us + scan.dim_us_lux / lux
        lag = (u1 - u0) / step_us * tau_us
        y1 = u1 - lag + (y0 - u0 + lag) * math.exp(-step_us / tau_us)
        n1 = scan.noise_kept * n0 + fresh * bell(mix(key, np.uint64(step_index * pixels + i)))
        row = i // scan.width
        at_us = scan.scan_us * row / scan.height
        while at_us < step_us:
            part = at_us / step_us
            above = y0 + n0 + (y1 + n1 - y0 - n0) * part + drift[i] * part - memory
            on = above >= thresholds[0, i]
            if on or above <= -thresholds[1, i]:
                memory += thresholds[0, i] if on else -thresholds[1, i]
                if count < len(events):
                    events[count, 0] = step_index * step_us + at_us
                    events[count, 1], events[count, 2] = i % scan.width, row
                    events[count, 3] = 1.0 if on else 0.0
                count += 1
            at_us += scan.scan_us
        state[0, i], state[1, i], state[2, i] = u1, y1, n1
        state[3, i] = memory - drift[i]
    return count
