"""Improved ESIM: ESIM with the pixel's finite bandwidth, leak, and reset to the signal.

Low and Lee, "Robust e-NeRF", ICCV 2023, and "Deblur e-NeRF", ECCV 2024.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from eqs.simulators.base import Simulator, require_not_negative, require_positive

ORDERS = (0, 2, 3, 4)


@dataclass(frozen=True, kw_only=True)
class ImprovedESIM(Simulator):
    """Fires when signal and leak have moved by a threshold since the last reset.

    The signal is `ln(I + dark / white)`, with the photocurrents of darkness and of white, after up
    to four orders of low-pass: the photoreceptor's two, whose time constants fall with the
    photocurrent, the source follower and the differencing amplifier. It is linear between frames.
    A pixel fires nothing in the refractory period after an event, and is reset to the signal that
    it then sees, so no contrast is made up for. It starts at a random point of that period. The
    leak adds to the signal exactly.

    In `fixed` mode the dark current counts in the time constants too, and pixels that leak start at
    random phases of it instead. In `faithful` mode there is no leak, as the published program
    computes it from a value that is not set yet, and black pixels stand still.

    Convention: the values of the circuit are those of a DVS128; a frame is taken as proportional to
    the photocurrent.

    Args:
        threshold_on_log: mean contrast of an ON event, natural-log units.
        threshold_off_log: mean contrast of an OFF event, as a positive number.
        threshold_sigma_log: standard deviation of both across pixels; none falls below 0.01.
        leak_hz: ON events per second of a pixel in constant light.
        refractory_us: refractory period after an event.
        order: of the low-pass: 0 none, 2 photoreceptor, 3 and source follower, 4 and amplifier.
        white_current_fa: photocurrent of grey level 255, femtoampere.
        dark_current_fa: photocurrent without light.
        amplifier_gain: of the photoreceptor's feedback.
        back_gate: the share of a gate's voltage that acts in its transistor, kappa.
        thermal_voltage_mv: of the sensor.
        photodiode_ff: capacitance at the photodiode, femtofarad.
        miller_ff: capacitance from the photodiode to the output.
        output_time_constant_us: of the photoreceptor's output.
        source_follower_hz: cutoff.
        amplifier_hz: cutoff of the differencing amplifier.
        seed: of mismatch and phases.

    Raises:
        ValueError: a threshold or a value of the circuit is not positive, the order is none of 0,
            2, 3 and 4, or another value is negative.

    Example:
        >>> frames = np.array([np.full((1, 1), level) for level in (64.0, 128.0)])
        >>> ideal = ImprovedESIM(threshold_on_log=0.2, order=0, dark_current_fa=1e-6)
        >>> ideal.simulate(frames, [0, 70_000]).t.tolist()
        [20197, 40395, 60593]
    """

    name: ClassVar[str] = "improved_esim"
    in_bands: ClassVar[bool] = True

    threshold_on_log: float = 0.25
    threshold_off_log: float = 0.25
    threshold_sigma_log: float = 0.0
    leak_hz: float = 0.0
    refractory_us: float = 0.0
    order: int = 4
    white_current_fa: float = 2000.0
    dark_current_fa: float = 4.0
    amplifier_gain: float = 140.0
    back_gate: float = 0.7
    thermal_voltage_mv: float = 25.0
    photodiode_ff: float = 35.0
    miller_ff: float = 0.6
    output_time_constant_us: float = 1815.0
    source_follower_hz: float = 3122.0
    amplifier_hz: float = 16000.0
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the parameters."""
        super().__post_init__()
        require_positive(
            self,
            "threshold_on_log",
            "threshold_off_log",
            "white_current_fa",
            "dark_current_fa",
            "amplifier_gain",
            "back_gate",
            "thermal_voltage_mv",
            "photodiode_ff",
            "miller_ff",
            "output_time_constant_us",
            "source_follower_hz",
            "amplifier_hz",
        )
        require_not_negative(self, "threshold_sigma_log", "leak_hz", "refractory_us")
        if self.order not in ORDERS:
            raise ValueError(f"Expected order 0, 2, 3 or 4, got {self.order}; set sim.order")

    @property
    def leaks(self) -> bool:
        """Whether a still pixel fires."""
        return self.leak_hz > 0 and self.mode == "fixed"

    @property
    def stochastic(self) -> bool:
        """Mismatch, the phase of the leak and the first refractory period are random."""
        return self.threshold_sigma_log > 0 or self.refractory_us > 0 or self.leaks

    def signal(self, levels: NDArray[np.float64]) -> NDArray[np.float64]:
        """Natural log of the photocurrent over that of white, at grey levels 0..255."""
        return np.log(levels / 255.0 + self.dark_current_fa / self.white_current_fa)

    def current_fa(self, levels: NDArray[np.float64]) -> NDArray[np.float64]:
        """The photocurrent that sets the time constants."""
        dark = self.dark_current_fa if self.mode == "fixed" else 0.0
        return levels / 255.0 * self.white_current_fa + dark
