"""Prophesee: the video-to-event simulator of OpenEB, a pixel between ESIM's and v2e's.

Metavision "video to event" on the CPU, part of Prophesee's OpenEB (core_ml).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from eqs.simulators.base import Simulator, require_not_negative, require_positive
from eqs.simulators.pixel.photoreceptor import log_intensity


@dataclass(frozen=True, kw_only=True)
class Prophesee(Simulator):
    """Level crossings of a log intensity that two filters have smoothed, with leak and shot noise.

    Each frame moves a first filter towards `ln(offset + I / 255)` and a second one towards the
    first, both by `min(1, q 2 pi cutoff dt)` with the light `q = (I + 20) / 275`. The second is
    linear between frames, and a pixel fires at each level it crosses. Thresholds differ from pixel
    to pixel, between 0.01 and 1. The memory leaks towards ON events. Shot noise fires both
    polarities at `shot_noise_hz (1 - 0.75 q)` in all.

    In `fixed` mode the robust crossing rule holds with the leak as part of the signal; pixels start
    at random phases of their leak; shot noise is a Poisson process whose events make the pixel
    forget pending contrast; black counts as grey level 1, as it lies 10 natural-log units below
    otherwise and its flicker would drown the scene. In `faithful` mode the official rule holds, so
    that a leak never fires by itself and blocks ON events in time; shot noise comes with the frame,
    is divided by the largest number of levels any pixel passed plus one, moves the memory by a
    threshold, and is absent from frames in which nothing fires. Logarithm and thresholds are
    float32 there.

    Args:
        threshold_on_log: mean contrast of an ON event, natural-log units.
        threshold_off_log: mean contrast of an OFF event, as a positive number.
        threshold_sigma_log: standard deviation of both across pixels.
        cutoff_hz: bandwidth of each filter at full brightness; 0 removes them.
        leak_hz: ON events per second of a pixel in constant light.
        shot_noise_hz: noise events per second, ON and OFF together, of a dark pixel.
        refractory_us: a pixel drops crossings for so long after an event; the contrast is lost.
        log_offset: added to the intensity, which runs from 0 to 1, before the logarithm.
        seed: of mismatch and noise.

    Raises:
        ValueError: a threshold or the offset is not positive, or another value is negative.

    Example:
        >>> frames = np.array([np.full((1, 1), level) for level in (64.0, 128.0)])
        >>> ideal = Prophesee(threshold_on_log=0.2, threshold_sigma_log=0, shot_noise_hz=0)
        >>> ideal.simulate(frames, [0, 70_000]).t.tolist()
        [20197, 40395, 60593]
    """

    name: ClassVar[str] = "prophesee"

    threshold_on_log: float = 0.15
    threshold_off_log: float = 0.1
    threshold_sigma_log: float = 0.001
    cutoff_hz: float = 0.0
    leak_hz: float = 0.0
    shot_noise_hz: float = 10.0
    refractory_us: float = 1.0
    log_offset: float = 1e-7
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the parameters."""
        super().__post_init__()
        require_positive(self, "threshold_on_log", "threshold_off_log", "log_offset")
        require_not_negative(
            self, "threshold_sigma_log", "cutoff_hz", "leak_hz", "shot_noise_hz", "refractory_us"
        )

    @property
    def stochastic(self) -> bool:
        """Mismatch, shot noise and, in `fixed` mode, the phase of the leak are random."""
        phases = self.leak_hz > 0 and self.mode == "fixed"
        return self.threshold_sigma_log > 0 or self.shot_noise_hz > 0 or phases

    def signal(self, levels: NDArray[np.float64]) -> NDArray[Any]:
        """The log intensity of grey levels 0..255."""
        if self.mode == "faithful":
            return log_intensity(levels.astype(np.float32), self.log_offset)
        return log_intensity(np.maximum(levels, 1.0), self.log_offset)
