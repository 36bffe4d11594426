"""ADV2E, reconstructed from its abstract: v2e with filters in continuous time.

The published words, of "ADV2E: Bridging the Gap Between Analogue Circuit and Discrete Frames in
the Video-to-Events Simulator" (2022), are analogue low-pass filtering, continuity sampling, and a
cutoff that does not depend on the frame rate. No equation, parameter or program of it is public.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from eqs.frames import GreyImage, Light, LightSource
from eqs.simulators.base import Simulator, require_not_negative, require_positive
from eqs.simulators.pixel.filtered import Circuit, FilteredPixels, Seen
from eqs.simulators.pixel.photoreceptor import MICROSECONDS

LAWS = ("small", "large")
LINEAR = Light()
WHITE = 255.0


@dataclass(frozen=True, kw_only=True)
class ADV2E(Simulator):
    """A reconstruction from its abstract: the light between frames is a line to an analogue filter.

    The signal is `ln((light + dark) / white)` of linear light. A low-pass whose corner is
    proportional to light and dark follows it exactly in continuous time, so that frames put in
    between on the same line change nothing, and a dark pixel goes on firing over several frames
    after an edge has passed. Where v2e takes one Euler step a frame, which is the whole way at
    video rates, this is a solution. Events move the memory by a threshold; what is crossed in the
    refractory period fires at its end.

    Time stamps are stochastic where the voltage has noise: it advances or delays a crossing by its
    standard deviation over the slope, at most by the filter's time constant, and fires still pixels
    at the rate of its first passages; such events reset the pixel.

    Args:
        threshold_on_log: mean contrast of an ON event, natural-log units.
        threshold_off_log: mean contrast of an OFF event, as a positive number.
        threshold_sigma_log: standard deviation of both across pixels; none falls below 0.01.
        cutoff_hz: corner of the filter at white.
        dark_level: light of darkness, 0 to 255.
        law: `small` for a filter, `large` for a photodiode that charges a capacitance: quick to
            brighten, slow to darken.
        second_cutoff_hz: corner of a second pole that does not depend on the light, 0 for none.
        refractory_us: a pixel is blind for so long after an event.
        voltage_noise_log: standard deviation of the filtered signal, natural-log units.
        seed: of mismatch and noise.

    Raises:
        ValueError: the law is neither, mode is faithful, a threshold, cutoff or the dark level is
            not positive, or another value is negative.

    Example:
        >>> frames = np.array([np.full((1, 1), level) for level in (60.0, 120.0)])
        >>> exact = ADV2E(threshold_sigma_log=0, voltage_noise_log=0, refractory_us=0)
        >>> exact.simulate(frames, [0, 50_000]).t.tolist()
        [16820, 29134, 41712]
    """

    name: ClassVar[str] = "adv2e"
    pixels: ClassVar = {}
    in_bands: ClassVar[bool] = True

    threshold_on_log: float = 0.2
    threshold_off_log: float = 0.2
    threshold_sigma_log: float = 0.03
    cutoff_hz: float = 300.0
    dark_level: float = 20.0
    law: str = "small"
    second_cutoff_hz: float = 0.0
    refractory_us: float = 500.0
    voltage_noise_log: float = 0.01
    seed: int = 0
    light: LightSource | None = LINEAR

    def __post_init__(self) -> None:
        """Check the parameters."""
        super().__post_init__()
        if self.law not in LAWS:
            raise ValueError(f"Expected law small or large, got {self.law!r}; set sim.law")
        require_positive(self, "threshold_on_log", "threshold_off_log", "cutoff_hz", "dark_level")
        require_not_negative(
            self, "threshold_sigma_log", "second_cutoff_hz", "refractory_us", "voltage_noise_log"
        )

    @property
    def stochastic(self) -> bool:
        """Thresholds and noise are random."""
        return self.threshold_sigma_log > 0 or self.voltage_noise_log > 0

    def circuit(self) -> Circuit:
        """What its pixels share."""
        second = self.second_cutoff_hz
        return Circuit(
            rate=_per_microsecond(self.cutoff_hz) * WHITE / (WHITE + self.dark_level),
            large=self.law == "large",
            pole_us=1 / _per_microsecond(second) if second else 0.0,
            refractory_us=float(self.refractory_us),
            resets=False,
        )

    def seen(self, image: GreyImage) -> Seen:
        """Log light, noise and time constants at the levels of an image."""
        light = np.log((image.levels + self.dark_level) / WHITE)
        tau_us = np.exp(-light) / self.circuit().rate
        noise = np.full_like(light, self.voltage_noise_log)
        return Seen(image.codes, light, tau_us, noise, noise_us=tau_us, leak=np.zeros_like(light))


def _per_microsecond(cutoff_hz: float) -> float:
    return 2 * math.pi * cutoff_hz * MICROSECONDS


ADV2E.pixels = {"fixed": FilteredPixels}
