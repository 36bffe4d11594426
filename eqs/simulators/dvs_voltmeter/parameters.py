"""DVS-Voltmeter: a voltage that drifts and diffuses between two barriers.

Lin, Ma, Guo and Wen, "DVS-Voltmeter: Stochastic Process-Based Event Simulator for Dynamic Vision
Sensors", ECCV 2022.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from eqs.simulators.base import Simulator, require_not_negative, require_positive


@dataclass(frozen=True, kw_only=True)
class DVSVoltmeter(Simulator):
    """Fires at the first passages of a Brownian motion with drift through +1 and -1.

    Within an interval of mean grey level `L` and change `d`, the voltage drifts by
    `gain (d / dt) / (L + dark) + leak + light_leak L` and spreads by
    `photon_noise sqrt(L) / (L + dark) + thermal_noise` per square root of a microsecond, with
    levels 0..255. A pixel that fires starts again at 0. Contrast is thus counted on
    `ln(L + dark)`, with a threshold of `1 / gain`. The default values are those of a DVS346.

    In `fixed` mode pixels start at random phases of their leak. In `faithful` mode all start at 0,
    so that still pixels of equal light leak in step; without drift both barriers are equally
    likely from anywhere and passages take twice as long; passages against the drift are too short;
    times are rounded to the microsecond, not floored.

    Convention: as published, a side is drawn first and then a passage time of that barrier alone,
    and an interval without event moves the voltage along a line towards the side drawn.

    Args:
        contrast_gain: thresholds per natural-log unit, k1.
        dark_level: grey level added to the light, k2.
        photon_noise_per_sqrt_us: spread that falls with the light, k3.
        leak_per_us: drift in the dark, thresholds per microsecond, k4.
        light_leak_per_us: drift per grey level of light, k5.
        thermal_noise_per_sqrt_us: spread that does not depend on the light, k6.
        seed: of the motion.

    Raises:
        ValueError: gain or dark level is not positive, or another value is negative.

    Example:
        >>> import numpy as np
        >>> frames = np.array([np.full((1, 1), level) for level in (90.0, 110.0)])
        >>> quiet = {"photon_noise_per_sqrt_us": 0, "thermal_noise_per_sqrt_us": 0}
        >>> ideal = DVSVoltmeter(contrast_gain=15, leak_per_us=0, light_leak_per_us=0, **quiet)
        >>> ideal.simulate(frames, [0, 50_000]).t.tolist()
        [20000, 40000]
    """

    name: ClassVar[str] = "dvs_voltmeter"
    version: ClassVar[int] = 2
    in_bands: ClassVar[bool] = True

    contrast_gain: float = 5.265
    dark_level: float = 20.0
    photon_noise_per_sqrt_us: float = 1e-4
    leak_per_us: float = 1e-7
    light_leak_per_us: float = 5e-9
    thermal_noise_per_sqrt_us: float = 1e-5
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the parameters."""
        super().__post_init__()
        require_positive(self, "contrast_gain", "dark_level")
        require_not_negative(
            self,
            "photon_noise_per_sqrt_us",
            "leak_per_us",
            "light_leak_per_us",
            "thermal_noise_per_sqrt_us",
        )

    @property
    def leaks(self) -> bool:
        """Whether a still pixel drifts."""
        return self.leak_per_us > 0 or self.light_leak_per_us > 0

    @property
    def stochastic(self) -> bool:
        """The motion and, in `fixed` mode, the phase of the leak are random."""
        spreads = self.photon_noise_per_sqrt_us > 0 or self.thermal_noise_per_sqrt_us > 0
        return spreads or (self.leaks and self.mode == "fixed")
