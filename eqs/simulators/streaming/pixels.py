"""What a stream asks of the pixels of a sensor."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from eqs.frames import GreyImage


class Interval(NamedTuple):
    """The time between two frames, on a clock that starts at the first frame."""

    frame: int
    """Number of the later frame, from 0."""
    start_us: int
    stop_us: int

    @property
    def span_us(self) -> int:
        """Length of the interval."""
        return self.stop_us - self.start_us


class Pixels(Protocol):
    """The state of all pixels of a sensor."""

    def advance(self, image: GreyImage, interval: Interval) -> NDArray[np.int64]:
        """Move to the image at the end of the interval and give the keys of its events.

        They may lie in a buffer that the next call uses again.
        No event may come before `interval.start_us`, now or later. Events should be written row by
        row, a pixel's own in the order of their times, which makes sorting them cheap.
        """
        ...


# Makes the pixels of a sensor, or of a part of it, from its first image.
Begin = Callable[[GreyImage], Pixels]
