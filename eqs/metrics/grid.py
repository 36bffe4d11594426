"""The windows in which streams are compared, as one thing that commands hand around."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class Grid:
    """The consecutive full windows in which streams are compared.

    Args:
        start_us: start of the first window.
        window_us: length of a window in microseconds.
        count: number of windows, warm-up included.
        extent_us: what the reference covers, its span or else its first to its last event; None
            where it has neither.
    """

    start_us: int
    window_us: int
    count: int
    extent_us: tuple[int, int] | None

    @property
    def stop_us(self) -> int:
        """End of the last window."""
        return self.start_us + self.count * self.window_us

    @property
    def starts_us(self) -> NDArray[np.int64]:
        """Start of every window."""
        return self.start_us + self.window_us * np.arange(self.count, dtype=np.int64)

    @property
    def share(self) -> float | None:
        """The part of the reference's extent that lies within the windows; None without extent."""
        if self.extent_us is None or self.extent_us[1] <= self.extent_us[0]:
            return None
        first, last = self.extent_us
        inside = min(self.stop_us, last) - max(self.start_us, first)
        return max(inside, 0) / (last - first)


def fewest_windows(warmup_windows: int) -> int:
    """Below so many windows that count a score says little, and a command says so.

    Convention: as many as the warm-up asks for, since so many it takes a state to settle and a
    stream that has fewer left had its warm-up cut short; never a single one.

    Example:
        >>> fewest_windows(20), fewest_windows(0)
        (20, 2)
    """
    return max(warmup_windows, 2)
