"""A frame that another program recorded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Frame:
    """A picture of the event sensor's own pixels.

    Args:
        time_us: middle of the exposure, or the only time that is known.
        picture: grey `(H, W)` or RGB `(H, W, 3)`, of 8 or 16 bits.
        exposure_us: start and stop of the exposure, where it is known.
    """

    time_us: int
    picture: NDArray[Any]
    exposure_us: tuple[int, int] | None = None
