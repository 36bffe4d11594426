"""Gazebo: the DVS plugin of the robot simulator, which compares grey levels without a logarithm.

Kaiser et al., "Towards a Framework for End-to-End Control of a Simulated Vehicle with Spiking
Neural Networks", SIMPAR 2016; gazebo_dvs_plugin.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.kernels import njit
from eqs.simulators.base import Simulator, require_positive
from eqs.simulators.streaming.keys import event_key
from eqs.simulators.streaming.pixels import Interval


@dataclass(frozen=True, kw_only=True)
class Gazebo(Simulator):
    """Fires once where the grey level differs from that at the last event by over a threshold.

    A pixel that fires takes the new grey level as its reference; the others keep theirs, so slow
    changes add up. There is at most one event per pixel and frame, at the time of the frame, and
    neither noise nor logarithm: dark pixels need more contrast.

    Convention: the published plugin names brightening OFF and darkening ON. `faithful` mode keeps
    that, `fixed` mode does not.

    Args:
        threshold_level: difference that must be exceeded, grey levels 0..255.

    Raises:
        ValueError: the threshold is not positive.

    Example:
        >>> frames = np.array([np.full((1, 1), level) for level in (50.0, 58.0, 66.0)])
        >>> events = Gazebo().simulate(frames, [0, 20_000, 40_000])
        >>> events.t.tolist(), events.p.tolist()
        ([40000], [1])
    """

    name: ClassVar[str] = "gazebo"

    threshold_level: float = 10.0

    def __post_init__(self) -> None:
        """Check the parameters."""
        super().__post_init__()
        require_positive(self, "threshold_level")


class GazeboPixels:
    """The grey level of each pixel's last event."""

    def __init__(self, model: Gazebo, image: GreyImage, sequence: str) -> None:
        """Settle on the first image."""
        self.model = model
        self.reference = image.levels[image.codes]
        self.keys = np.empty(image.codes.size, np.int64)

    def advance(self, image: GreyImage, interval: Interval) -> NDArray[np.int64]:
        """Events of one interval."""
        count = _fire(
            image.codes,
            image.levels,
            self.reference,
            float(self.model.threshold_level),
            0 if self.model.mode == "fixed" else 1,
            interval.stop_us,
            self.keys,
        )
        return self.keys[:count]


@njit(cache=True, nogil=True)
def _fire(
    codes: NDArray[Any],
    levels: NDArray[np.float64],
    reference: NDArray[np.float64],
    threshold_level: float,
    darkening_polarity: int,
    stop_us: int,
    keys: NDArray[np.int64],
) -> int:
    count = 0
    for pixel in range(codes.size):
        difference = levels[codes[pixel]] - reference[pixel]
        if abs(difference) > threshold_level:
            polarity = darkening_polarity if difference < 0 else 1 - darkening_polarity
            keys[count] = event_key(stop_us, pixel, polarity)
            reference[pixel] = levels[codes[pixel]]
            count += 1
    return count


Gazebo.pixels = dict.fromkeys(("fixed", "faithful"), GazeboPixels)
