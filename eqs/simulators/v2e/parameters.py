"""V2E: a pixel with finite bandwidth, mismatch, leak, shot noise and refractory period.

Hu, Liu and Delbruck, "v2e: From Video Frames to Realistic DVS Events", CVPR Workshops 2021.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from eqs.simulators.base import Simulator, require_not_negative, require_positive


@dataclass(frozen=True, kw_only=True)
class V2E(Simulator):
    """The published pixel: lin-log photoreceptor, low-pass, leaking memory, shot noise.

    Each frame moves the filtered log intensity `f` by `epsilon (u - f)`, where `u` is the lin-log
    of the grey level and `epsilon = min(1, q 2 pi cutoff dt)` grows with the light,
    `q = (I + 20) / 275`. The memory leaks towards ON events, at `leak_hz` in the mean. Events
    carry the memory to the last level passed. Shot noise fires both polarities at
    `shot_noise_hz (1 - 0.75 q)` in all and makes the pixel forget pending contrast. At video rates
    the filter is inert: 300 Hz filters nothing that is sampled at 20 Hz.

    In `fixed` mode events come when the signal, linear within the interval, crosses its level; the
    refractory period holds at any frame rate and delays an event until it ends; pixels start at
    random phases of their leak; shot noise is a Poisson process with times of its own. In
    `faithful` mode all pixels share a grid of times set by the busiest, the refractory period
    matters only where that grid is finer, pixels leak in step and shot noise comes with the frame.

    Args:
        threshold_on_log: mean contrast of an ON event, natural-log units.
        threshold_off_log: mean contrast of an OFF event, as a positive number.
        threshold_sigma_log: standard deviation of both across pixels; none falls below 0.01.
        cutoff_hz: bandwidth at full brightness; 0 removes the filter.
        leak_hz: ON events per second of a pixel in constant light.
        leak_jitter: standard deviation of the leak from frame to frame, as a share of it.
        leak_spread_decades: standard deviation across pixels of the leak's decimal logarithm.
        shot_noise_hz: noise events per second, ON and OFF together, of a dark pixel.
        refractory_us: a pixel waits so long after an event; the contrast is kept.
        knee_level: grey level, 0..255, below which the photoreceptor is linear.
        seed: of mismatch and noise.

    Raises:
        ValueError: a threshold is not positive, the knee is below 1, or another value is negative.

    Example:
        >>> import numpy as np
        >>> frames = np.array([np.full((1, 1), level) for level in (64.0, 128.0)])
        >>> ideal = V2E(threshold_sigma_log=0, cutoff_hz=0, leak_hz=0, shot_noise_hz=0)
        >>> ideal.simulate(frames, [0, 70_000]).t.tolist()
        [20197, 40395, 60593]
    """

    name: ClassVar[str] = "v2e"

    threshold_on_log: float = 0.2
    threshold_off_log: float = 0.2
    threshold_sigma_log: float = 0.03
    cutoff_hz: float = 300.0
    leak_hz: float = 0.01
    leak_jitter: float = 0.1
    leak_spread_decades: float = 0.1
    shot_noise_hz: float = 0.001
    refractory_us: float = 500.0
    knee_level: float = 20.0
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the parameters."""
        super().__post_init__()
        require_positive(self, "threshold_on_log", "threshold_off_log")
        require_not_negative(
            self,
            "threshold_sigma_log",
            "cutoff_hz",
            "leak_hz",
            "leak_jitter",
            "leak_spread_decades",
            "shot_noise_hz",
            "refractory_us",
        )
        if not 1 < self.knee_level <= 255:
            raise ValueError(
                f"Expected knee_level above 1 and up to 255, got {self.knee_level}; "
                "set sim.knee_level"
            )

    @property
    def stochastic(self) -> bool:
        """Mismatch, leak and shot noise are random."""
        return self.threshold_sigma_log > 0 or self.leak_hz > 0 or self.shot_noise_hz > 0
