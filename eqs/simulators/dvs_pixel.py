"""A physical pixel: photodiode, source follower, leaking memory, and noise of its own electrons.

In the spirit of Graca and Delbruck, "Towards a Physically Realistic Computationally Efficient DVS
Pixel Model", 2025 (arXiv 2505.07386): large-signal equations, and noise events by their first
passage instead of small steps. The equations are ours, restated from the pixel's circuit.
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

ELECTRON_FC = 1.602176634e-4  # femtocoulomb
WHITE = 255.0
LINEAR = Light()
RELATED = ("dsec_mini", "dsec_mini_smoke")
"""Data sets whose reference sensor is a circuit of this kind."""


@dataclass(frozen=True, kw_only=True)
class DVSPixel(Simulator):
    """A photodiode charged by its current, a source follower, a memory that leaks.

    The photodiode follows the light by its large-signal law: quick to brighten, slow to darken. Its
    noise is the shot noise of photocurrent and feedback transistor through both filters, of power
    `(4 q / i) (pi / 2) f1 f2 / (f1 + f2)` in squared log units, where the corner `f1` of the
    photodiode rises with the current: nearly the same in all dim light, less in bright light, and
    quick in bright light, so that noise events are most frequent in between. Noise moves crossings
    and fires still pixels at the rate of its first passages. After each event and a dead time the
    memory takes the signal.

    Convention: values are those of a DAVIS346 rather than of the reference sensor of `dsec_mini`,
    which is a circuit of this kind too; judged by that one, rows are marked.

    Args:
        threshold_on_log: mean contrast of an ON event, natural-log units.
        threshold_off_log: mean contrast of an OFF event, as a positive number.
        threshold_sigma_log: standard deviation of both across pixels; none falls below 0.01.
        white_current_fa: photocurrent of level 255, femtoampere.
        dark_current_fa: photocurrent without light.
        photodiode_hz: corner of the photodiode at white.
        source_follower_hz: corner of what follows it.
        noisy: whether electrons make noise.
        leak_hz: ON events per second of a dark pixel from the leak of its memory.
        leak_hz_at_white: what the light adds to that at white.
        refractory_us: a pixel is blind for so long after an event.
        seed: of mismatch and noise.

    Raises:
        ValueError: mode is faithful, a threshold, current or corner is not positive, or another
            value is negative.

    Example:
        >>> frames = np.array([np.full((1, 1), level) for level in (60.0, 180.0)])
        >>> ideal = DVSPixel(threshold_sigma_log=0, noisy=False, leak_hz=0, leak_hz_at_white=0)
        >>> len(ideal.simulate(frames, [0, 50_000]))
        7
    """

    name: ClassVar[str] = "dvs_pixel"
    pixels: ClassVar = {"fixed": FilteredPixels}
    in_bands: ClassVar[bool] = True

    threshold_on_log: float = 0.25
    threshold_off_log: float = 0.25
    threshold_sigma_log: float = 0.035
    white_current_fa: float = 500.0
    dark_current_fa: float = 5.0
    photodiode_hz: float = 2000.0
    source_follower_hz: float = 5000.0
    noisy: bool = True
    leak_hz: float = 0.1
    leak_hz_at_white: float = 0.2
    refractory_us: float = 500.0
    seed: int = 0
    light: LightSource | None = LINEAR

    def __post_init__(self) -> None:
        """Check the parameters."""
        super().__post_init__()
        require_positive(
            self, "threshold_on_log", "threshold_off_log", "white_current_fa", "dark_current_fa",
            "photodiode_hz", "source_follower_hz",
        )  # fmt: skip
        require_not_negative(
            self, "threshold_sigma_log", "leak_hz", "leak_hz_at_white", "refractory_us"
        )

    @property
    def stochastic(self) -> bool:
        """Thresholds and noise are random."""
        return self.threshold_sigma_log > 0 or self.noisy

    def caveat(self, judge: str) -> str:
        """The reference sensor of the rendered street is nearly the same circuit."""
        family = "of the same family as the sensor that judges it" * (judge in RELATED)
        return family or super().caveat(judge)

    def circuit(self) -> Circuit:
        """What its pixels share."""
        return Circuit(
            rate=2 * math.pi * self.photodiode_hz * MICROSECONDS,
            large=True,
            pole_us=1 / (2 * math.pi * self.source_follower_hz * MICROSECONDS),
            refractory_us=float(self.refractory_us),
            resets=True,
        )

    def seen(self, image: GreyImage) -> Seen:
        """Log photocurrent, time constants, noise and leak at the levels of an image."""
        share = image.levels / WHITE
        current_fa = share * self.white_current_fa + self.dark_current_fa
        light = np.log(current_fa / (self.white_current_fa + self.dark_current_fa))
        corner_hz = self.photodiode_hz * np.exp(light)
        both_hz = corner_hz * self.source_follower_hz / (corner_hz + self.source_follower_hz)
        power = 4 * ELECTRON_FC / current_fa * math.pi / 2 * both_hz
        leak_hz = self.leak_hz + self.leak_hz_at_white * share
        return Seen(
            codes=image.codes,
            light_log=light,
            tau_us=np.exp(-light) / self.circuit().rate,
            noise_log=np.sqrt(power) * self.noisy,
            noise_us=1 / (2 * math.pi * both_hz * MICROSECONDS),
            leak=self.threshold_on_log * leak_hz * MICROSECONDS,
        )
