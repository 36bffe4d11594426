"""The reference event camera: a pixel circuit fed with light, never with frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from eqs.scenes.circuit import Array, Circuit, advance
from eqs.scenes.sensor_stream import EventSensor, SensorStream

ELECTRON_C = 1.602176634e-19


@dataclass(frozen=True, kw_only=True)
class ReferenceSensor(EventSensor):
    """Parameters of the reference event camera, and nothing else.

    A photodiode with dark current drives a logarithmic photoreceptor of second order whose
    bandwidth and damping follow the photocurrent; shot noise enters ahead of it, so dim pixels
    are slow and noisy. A change detector with mismatched thresholds compares the output with the
    value it memorised: after each event and a refractory period it memorises the signal as it is
    then, and what changed meanwhile is lost. Leakage in the memory brings ON events without any
    change, in proportion to the light plus a dark part; a few hot pixels leak much faster.
    Events wait for a row-wise readout, so they arrive late and share times along rows.

    It stands in for a real sensor in the rendered world; it is not one. Its parameters come from
    published measurements and are not tuned to results: `definition_hash` says which they were.

    Args:
        photocurrent_fa_per_lux: photocurrent per lux at the focal plane, fA.
        dark_current_fa: photodiode dark current, fA.
        amplifier_gain: voltage gain of the photoreceptor's feedback amplifier.
        back_gate: slope factor kappa of the feedback transistor.
        thermal_voltage_v: V_T.
        photodiode_capacitance_ff: capacitance at the photodiode node, fF.
        miller_capacitance_ff: capacitance between input and output of the amplifier, fF.
        amplifier_time_us: time constant of the amplifier's output node, us.
        shot_noise_factor: power of the shot noise relative to the photodiode's alone.
        leak_hz: ON events per pixel and second from leakage in the dark.
        leak_hz_per_klux: what parasitic photocurrent adds per klux at the focal plane.
        leak_mismatch: standard deviation of the natural log of a pixel's leakage.
        hot_pixel_fraction: share of the pixels that leak fast.
        hot_pixel_hz: mean rate of a hot pixel's ON events; exponentially distributed.
        refractory_us: time after an event in which the pixel is held in reset, us.
        latency_us: delay of comparator and handshake, us.
        jitter_us: standard deviation of that delay, us.
        row_service_us: time the readout spends on one row, us.

    Source: circuit and its constants as in the linear analysis of the DVS128 pixel (Lichtsteiner
    et al. 2008) used by Low and Lee 2024; configs/sensor/reference_sensor.yaml says where every
    number comes from.
    """

    scales: ClassVar[Mapping[str, Mapping[str, float]]] = {
        "contrast": {"threshold_on_log": 1, "threshold_off_log": 1},
        "balance": {"threshold_on_log": -1, "threshold_off_log": 1},
        "slowness": {
            "photodiode_capacitance_ff": 1, "miller_capacitance_ff": 1, "amplifier_time_us": 1,
        },
        "noise": {"shot_noise_factor": 2},  # a power: so many times the standard deviation
        "leak": {"leak_hz": 1, "leak_hz_per_klux": 1},
        "hot_pixels": {"hot_pixel_fraction": 1},
        "mismatch": {"threshold_mismatch_log": 1},
        "refractory": {"refractory_us": 1},
        "jitter": {"jitter_us": 1, "latency_us": 1},
    }  # fmt: skip

    threshold_on_log: float = 0.223
    threshold_off_log: float = 0.223
    threshold_mismatch_log: float = 0.021
    photocurrent_fa_per_lux: float = 90.0
    dark_current_fa: float = 4.0
    amplifier_gain: float = 140.0
    back_gate: float = 0.7
    thermal_voltage_v: float = 0.025
    photodiode_capacitance_ff: float = 35.0
    miller_capacitance_ff: float = 0.6
    amplifier_time_us: float = 1815.0
    shot_noise_factor: float = 2.0
    leak_hz: float = 0.1
    leak_hz_per_klux: float = 0.2
    leak_mismatch: float = 0.4
    hot_pixel_fraction: float = 5e-4
    hot_pixel_hz: float = 40.0
    refractory_us: float = 300.0
    latency_us: float = 40.0
    jitter_us: float = 20.0
    row_service_us: float = 0.2

    def __post_init__(self) -> None:
        """Refuse values the circuit cannot have."""
        self.require("threshold_on_log", "threshold_off_log", "dark_current_fa", "step_us")

    def start(
        self, height: int, width: int, *, noise_key: tuple[int, ...], start_us: int = 0
    ) -> ReferenceStream:
        """Switch the sensor on; `noise_key` names the recording and thereby its noise."""
        return ReferenceStream(self, height, width, noise_key=noise_key, start_us=start_us)

    def circuit(self) -> Circuit:
        """The circuit's constants in seconds and lux, as the compiled code reads them."""
        volts = self.thermal_voltage_v
        # tau = C V_T / i, expressed for i in fA.
        return Circuit(
            fa_per_lux=self.photocurrent_fa_per_lux,
            dark_fa=self.dark_current_fa,
            input_s_fa=self.photodiode_capacitance_ff * volts,
            miller_s_fa=self.miller_capacitance_ff * volts,
            gain=self.amplifier_gain,
            loop_gain=self.back_gate * self.amplifier_gain + 1.0,
            output_s=1e-6 * self.amplifier_time_us,
            step_s=1e-6 * self.step_us,
            noise_fa=self.shot_noise_factor * ELECTRON_C * 1e15 / (1e-6 * self.step_us),
            refractory_us=self.refractory_us,
            latency_us=self.latency_us,
            jitter_us=self.jitter_us,
            row_service_us=self.row_service_us,
            leak_per_lux=self.leak_hz_per_klux * 1e-3 / max(self.leak_hz, 1e-9),
        )


class ReferenceStream(SensorStream):
    """One recording of a `ReferenceSensor`.

    Convention: between two pictures the photoreceptor's output runs straight.
    """

    def __init__(
        self,
        sensor: ReferenceSensor,
        height: int,
        width: int,
        *,
        noise_key: tuple[int, ...],
        start_us: int,
    ) -> None:
        """Draw the sensor's fixed pattern."""
        # A pixel remembers its output, the slope per second, the memorised value, refractory us.
        super().__init__(
            sensor,
            height,
            width,
            rows=4,
            row_service_us=sensor.row_service_us,
            noise_key=noise_key,
            start_us=start_us,
        )
        self._circuit = sensor.circuit()
        count, pattern = height * width, self._pattern
        leak_hz = sensor.leak_hz * np.exp(sensor.leak_mismatch * pattern.standard_normal(count))
        hot = pattern.random(count) < sensor.hot_pixel_fraction
        leak_hz[hot] += pattern.exponential(sensor.hot_pixel_hz, count)[hot]
        self._leak_per_us = (1e-6 * leak_hz * sensor.threshold_on_log).astype(np.float32)

    def _settle(self, picture: NDArray[np.float32]) -> None:
        circuit = self._circuit
        self._state[0] = np.log(circuit.fa_per_lux * picture + circuit.dark_fa)
        self._state[2] = self._memories(self._state[0], np.random.default_rng(self._phase_seed))

    def _run(self, picture: NDArray[np.float32], state: NDArray[np.float32], room: Array) -> int:
        return advance(
            state,
            picture,
            self._thresholds,
            self._leak_per_us,
            self._circuit,
            self._key,
            self._steps,
            self._width,
            room,
        )
