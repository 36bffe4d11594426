"""Streets to render frames of: those of recordings by name, and how they are painted."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from eqs.scenes.generate import SPLITS, VERSION, SequencePlan
from eqs.scenes.plan import Street
from eqs.scenes.sensor import ReferenceSensor
from eqs.scenes.world import DrivingWorld

FRAMES: Final = 60  # of a recording of dsec_mini


def recorded_street(split: str, index: int, seed: int = 0) -> Street:
    """The street of a recording of `dsec_mini`.

    Args:
        split: train, val or test.
        index: number of the recording.
        seed: of the data set.

    Raises:
        ValueError: there is no such recording.

    Example:
        >>> recorded_street("test", 1).night, recorded_street("test", 1).seed
        (True, (0, 2, 1, 0))
    """
    if split not in SPLITS or index < 0:
        raise ValueError(
            f"Expected a split among {', '.join(SPLITS)} and a number of 0 or more, got {split} "
            f"and {index}; set street.split and street.index"
        )
    recording = SequencePlan(
        split=split, index=index, height=1, width=1, frames=FRAMES, seed=seed,
        sensor=ReferenceSensor(),
    )  # fmt: skip
    return recording.street


class PaintedStreet:
    """A street as `dsec_mini` shows it: grey, with all surfaces lit once and for all.

    Args:
        height: rows of the image.
        width: columns of the image.
        seed: integers that name the street.
        night: street lamps, lit windows and headlights instead of daylight.
        still: the camera waits instead of driving.
        duration_s: for how long there shall be something to see.
    """

    version = f"painted {VERSION}"

    def __init__(
        self,
        *,
        height: int,
        width: int,
        seed: tuple[int, ...],
        night: bool = False,
        still: bool = False,
        duration_s: float = 3.0,
    ) -> None:
        """Draw the street."""
        self.world = DrivingWorld(
            height=height, width=width, seed=seed, night=night, still=still, duration_s=duration_s
        )

    def photocurrent(self, t_us: float) -> NDArray[np.float32]:
        """Light in lux at `t_us` microseconds since the start, (H, W); grey has no colour."""
        return self.world.radiance(t_us)
