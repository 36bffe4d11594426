"""What a foreign event file held, before it becomes a stream in this project's convention."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, BinaryIO

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
        return self.late(None)

    def late(self, newest: int | None) -> int:
        """Events that come after a later one, these or one of those before.

        Args:
            newest: the latest time before these; None where they are the first.
        """
        if not len(self.t):
            return 0
        if bool((self.t[1:] >= self.t[:-1]).all()) and (newest is None or newest <= self.t[0]):
            return 0
        latest = np.maximum.accumulate(self.t)
        return int((self.t < (latest if newest is None else np.maximum(latest, newest))).sum())

    def sorted(self) -> Decoded:
        """The same events by time; equal times keep the file's order."""
        if not self.disorder:
            return self
        order = np.argsort(self.t, kind="stable")
        return replace(self, **{name: getattr(self, name)[order] for name in "txyp"})

    def __getitem__(self, index: slice) -> Decoded:
        """The events at a slice of places, as views."""
        return replace(self, **{name: getattr(self, name)[index] for name in "txyp"})

    def events(self, height: int | None = None, width: int | None = None) -> Events:
        """The stream, sorted by time; equal times keep the file's order.

        Args:
            height: rows of the sensor, where the file does not say.
            width: columns of the sensor, where the file does not say.

        Raises:
            ValueError: nobody says the size, the file says another, or an event is outside of it.
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
        part = self.sorted()
        fields = {name: getattr(part, name) for name in "txyp"}
        return Events.from_arrays(**fields, height=size[0], width=size[1])


def blocks(file: BinaryIO, size: int, word: int) -> Iterator[bytes]:
    """The rest of a file, about `size` bytes at a time, in whole words; at least one block.

    What is left of a word that was cut off is left out.

    Example:
        >>> from io import BytesIO
        >>> list(blocks(BytesIO(b"abcdefg"), size=5, word=2))
        [b'abcd', b'ef']
    """
    whole = max(size // word, 1) * word
    content = file.read(whole)
    yield content[: len(content) // word * word]
    while len(content) == whole:
        content = file.read(whole)
        if len(content) >= word:
            yield content[: len(content) // word * word]


class Clock:
    """Counts on the times of a clock that begins again: a fall of more than half of it is a turn.

    Args:
        period: the time after which it begins again.

    Example:
        >>> clock = Clock(256)
        >>> clock.counted(np.array([250, 255, 3])).tolist()
        [250, 255, 259]
        >>> clock.counted(np.array([2, 9])).tolist()
        [258, 265]
    """

    def __init__(self, period: int) -> None:
        """Begin before the first time."""
        self.period = period
        self.last: int | None = None
        self.turned = 0

    def counted(self, times: NDArray[Any]) -> NDArray[np.int64]:
        """The next times, counted on."""
        if not len(times):
            return np.zeros(0, np.int64)
        told = times.astype(np.int64)
        steps = np.diff(told, prepend=told[0] if self.last is None else self.last)
        turns = (steps < -self.period // 2).astype(np.int64) - (steps > self.period // 2)
        turned = self.turned + self.period * turns.cumsum()
        self.last, self.turned = int(told[-1]), int(turned[-1])
        counted: NDArray[np.int64] = told + turned
        return counted


def joined(pieces: Iterable[Decoded], kind: str) -> Decoded:
    """All pieces of a file as one; nothing of that kind where there is no piece."""
    parts = list(pieces)
    if not parts:
        none = np.zeros(0, np.int64)
        return Decoded(kind=kind, t=none, x=none, y=none, p=none)
    if len(parts) == 1:
        return parts[0]
    columns = {name: [getattr(part, name) for part in parts] for name in "txyp"}
    first, dropped = parts[0], sum(part.dropped for part in parts)
    parts.clear()  # so that every column can go as soon as it is joined
    held = {name: np.concatenate(columns.pop(name)) for name in "txyp"}
    return Decoded(kind=first.kind, **held, height=first.height, width=first.width, dropped=dropped)
