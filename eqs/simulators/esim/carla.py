"""CARLA: the driving simulator's DVS camera, a descendant of ESIM.

Dosovitskiy et al., "CARLA: An Open Urban Driving Simulator", CoRL 2017; its sensor.camera.dvs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from eqs.simulators.esim.parameters import ESIM


@dataclass(frozen=True, kw_only=True)
class CARLA(ESIM):
    """ESIM's pixel on grey values with fractions, with an optional linear scale.

    Colour becomes grey without rounding. Where `logarithmic` is off, the signal is the grey level
    0..255 itself and thresholds count in grey levels. Modes differ as in ESIM, except that the
    first interval is sound in both: the program never shared that buffer.

    Args:
        threshold_on_log: contrast that fires an ON event, natural-log units or grey levels.
        threshold_off_log: the same for OFF, as a positive number.
        threshold_sigma_log: standard deviation of the thresholds; they never fall below 0.01.
        log_offset: added to the intensity, which runs from 0 to 1, before the logarithm.
        refractory_us: a pixel drops crossings for so long after an event; the contrast is lost.
        seed: of the thresholds; matters where `threshold_sigma_log` is above 0.
        logarithmic: whether the pixel sees the logarithm or the grey level.

    Raises:
        ValueError: a threshold or the offset is not positive, or another value is negative.

    Example:
        >>> frames = np.array([np.full((1, 1), level) for level in (10.0, 20.0)])
        >>> linear = CARLA(logarithmic=False, threshold_on_log=2.5)
        >>> linear.simulate(frames, [0, 40_000]).t.tolist()
        [10000, 20000, 30000, 40000]
    """

    name: ClassVar[str] = "carla"
    rounds_luma: ClassVar[bool] = False
    shares_first_buffer: ClassVar[bool] = False

    threshold_on_log: float = 0.3
    threshold_off_log: float = 0.3
    logarithmic: bool = True

    def signal(self, levels: NDArray[np.float64]) -> NDArray[Any]:
        """The signal at grey levels 0..255; rounded to float32 in `faithful` mode."""
        if self.logarithmic:
            return super().signal(levels)
        return levels.astype(np.float32) if self.mode == "faithful" else levels
