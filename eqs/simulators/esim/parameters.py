"""ESIM: an ideal pixel on log-linear interpolated frames.

Rebecq, Gehrig and Scaramuzza, "ESIM: an Open Event Camera Simulator", CoRL 2018.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from eqs.simulators.base import Simulator, require_not_negative, require_positive
from eqs.simulators.pixel.photoreceptor import log_intensity


@dataclass(frozen=True, kw_only=True)
class ESIM(Simulator):
    """Fires whenever the log intensity has moved by a threshold since the last event.

    The log intensity `L = ln(offset + I / 255)` is linear between frames, a pixel fires at each
    level `r + j C` it crosses and has neither bandwidth nor leak nor shot noise.

    In `fixed` mode the threshold mismatch is drawn once per pixel and the robust crossing rule
    holds. In `faithful` mode it is drawn anew for every frame and the official rule holds, which
    loses events (40 % at C = 0.2 and sigma = 0.006); the log is float32, and the first interval has
    the published program's shared buffer, which shifts the second and later events of a pixel.

    Args:
        threshold_on_log: contrast in natural-log units that fires an ON event.
        threshold_off_log: the same for OFF, as a positive number.
        threshold_sigma_log: standard deviation of the thresholds; they never fall below 0.01.
        log_offset: added to the intensity, which runs from 0 to 1, before the logarithm.
        refractory_us: a pixel drops crossings for so long after an event; the contrast is lost.
        seed: of the thresholds; matters where `threshold_sigma_log` is above 0.

    Raises:
        ValueError: a threshold or the offset is not positive, or another value is negative.

    Example:
        >>> frames = np.array([np.full((1, 1), level) for level in (64.0, 128.0)])
        >>> events = ESIM(log_offset=1e-9).simulate(frames, [0, 70_000])
        >>> events.t.tolist(), events.p.tolist()
        ([20197, 40395, 60593], [1, 1, 1])
    """

    name: ClassVar[str] = "esim"
    shares_first_buffer: ClassVar[bool] = True
    """Whether the program keeps start and reference in one buffer during the first interval."""

    threshold_on_log: float = 0.2
    threshold_off_log: float = 0.2
    threshold_sigma_log: float = 0.0
    log_offset: float = 1e-3
    refractory_us: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the parameters."""
        super().__post_init__()
        require_positive(self, "threshold_on_log", "threshold_off_log", "log_offset")
        require_not_negative(self, "threshold_sigma_log", "refractory_us")

    @property
    def stochastic(self) -> bool:
        """Only the thresholds are random."""
        return self.threshold_sigma_log > 0

    def signal(self, levels: NDArray[np.float64]) -> NDArray[Any]:
        """The signal at grey levels 0..255; rounded to float32 in `faithful` mode."""
        signal = log_intensity(levels, self.log_offset)
        return signal.astype(np.float32) if self.mode == "faithful" else signal
