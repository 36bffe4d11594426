"""What a foreign event file held, before it becomes a stream in this project's convention."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.events.stream import Events


@dataclass(frozen=True, kw_only=True, eq=False)
class Decoded:
    """Events as a file gives them, in its order.

    Args:
        kind: what the file is, in words.
        t: times, int64 microseconds.
        x: columns, counted from the left.
        y: rows, counted from the top.
        p: 1 where the pixel became brighter, else 0.
        height: rows of the sensor, where the file says so.
        width: columns of the sensor, where the file says so.
        dropped: words that should be events and have no time or place yet.
    """

    kind: str
    t: NDArray[np.int64]
    x: NDArray[Any]
    y: NDArray[Any]
    p: NDArray[Any]
    height: int | None = None
    width: int | None = None
    dropped: int = 0

    @property
    def disorder(self) -> int:
        """Events that come after a later one."""
        return self.disorder_after(np.iinfo(np.int64).min)

    def disorder_after(self, newest_us: int) -> int:
        """Events that come after a later one, where one of that time came before these."""
        if not len(self.t):
            return 0
        latest = np.maximum(np.maximum.accumulate(self.t), newest_us)
        return int((self.t < latest).sum())

    def size(self, height: int | None = None, width: int | None = None) -> tuple[int, int]:
        """Height and width of the sensor.

        Args:
            height: rows of the sensor, where the file does not say.
            width: columns of the sensor, where the file does not say.

        Raises:
            ValueError: nobody says the size, or the file says another.
        """
        size: list[int] = []
        for name, stored, given in (
            ("height", self.height, height),
            ("width", self.width, width),
        ):
            if stored is None and given is None:
                raise ValueError(
                    f"Expected the sensor's {name}, which {self.kind} does not carry; pass {name}="
                )
            if stored is not None and given is not None and stored != given:
                raise ValueError(
                    f"Expected a sensor with {name} {given}, got {stored} in {self.kind}; leave "
                    f"{name} out"
                )
            size.append(int(stored if stored is not None else given or 0))
        return size[0], size[1]

    def events(self, height: int | None = None, width: int | None = None) -> Events:
        """The stream, sorted by time; equal times keep the file's order.

        Args:
            height: rows of the sensor, where the file does not say.
            width: columns of the sensor, where the file does not say.

        Raises:
            ValueError: nobody says the size, the file says another, or an event is outside of it.
        """
        height, width = self.size(height, width)
        fields = {name: getattr(self, name) for name in "txyp"}
        if self.disorder:
            order = np.argsort(self.t, kind="stable")
            fields = {name: values[order] for name, values in fields.items()}
        return Events.from_arrays(**fields, height=height, width=width)


def unwrapped(times: NDArray[np.int64], period: int) -> NDArray[np.int64]:
    """Times of a clock that begins again, counted on: a fall of more than half of it is a turn.

    Example:
        >>> unwrapped(np.array([250, 255, 3, 2, 9]), 256).tolist()
        [250, 255, 259, 258, 265]
    """
    steps = np.diff(times)
    turns = (steps < -period // 2).astype(np.int64) - (steps > period // 2)
    counted: NDArray[np.int64] = (
        times + period * np.concatenate([[0], turns.cumsum()])[: len(times)]
    )
    return counted


def last_before(words: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Index of the last marked word at or before each, -1 where there is none yet.

    Example:
        >>> last_before(np.array([False, True, False, True])).tolist()
        [-1, 1, 1, 3]
    """
    return np.maximum.accumulate(np.where(words, np.arange(len(words)), -1))
