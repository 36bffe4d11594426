"""Streets to render frames of: those of recordings by name, and how they are painted."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from eqs.scenes.plan import Street
from eqs.scenes.sensor import ReferenceSensor
from eqs.scenes.sequence import SPLITS, VERSION, SequencePlan
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


class PaintedStreet(DrivingWorld):
    """A street as `dsec_mini` shows it: grey, with all surfaces lit once and for all."""

    version = f"painted {VERSION}"

    def photocurrent(self, t_us: float) -> NDArray[np.float32]:
        """Light in lux at `t_us` microseconds since the start, (H, W); grey has no colour."""
        return self.radiance(t_us)
