"""The event stream type that every other part of the package speaks."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.clock import backwards

FIELDS = {"t": np.int64, "x": np.uint16, "y": np.uint16, "p": np.uint8}


def as_field(name: str, values: NDArray[Any]) -> NDArray[Any]:
    """Numbers as the type of an event field, t, x, y or p.

    Raises:
        ValueError: a value is not a whole number or does not fit the field.
    """
    dtype = FIELDS[name]
    if np.can_cast(values.dtype, dtype, "safe"):
        return np.ascontiguousarray(values, dtype)
    with np.errstate(invalid="ignore"):
        array = values.astype(dtype)
    if np.array_equal(array, values):
        return np.ascontiguousarray(array)
    raise ValueError(
        f"Expected events.{name} to hold whole numbers that fit {np.dtype(dtype)}, got values "
        f"from {values.min()} to {values.max()}; use microseconds for t, pixels for x and y, "
        "0 and 1 for p"
    )


@dataclass(frozen=True, slots=True, eq=False)
class Events:
    """A time-sorted stream of events from one sensor.

    Convention: `t` is int64 microseconds on the recording's own clock, windows are half-open
    `[start, stop)`, `p` is 1 where the pixel became brighter and 0 where it became darker, `x`
    counts columns from the left and `y` rows from the top. A span says when the sensor was
    watching: a quiet second within it is silence, one outside it is not known. Events that leave
    the sensor late may lie behind its end.

    Args:
        t: time of each event, int64 microseconds, never decreasing, shape (n,).
        x: column, uint16, smaller than `width`, shape (n,).
        y: row, uint16, smaller than `height`, shape (n,).
        p: polarity, uint8, 0 or 1, shape (n,).
        height: rows of the sensor.
        width: columns of the sensor.
        span_us: start and stop of the time that was watched; None where nobody noted it.

    Raises:
        ValueError: a field has the wrong type or length, time runs backwards, a coordinate lies
            outside the sensor, a polarity is neither 0 nor 1, or the span stops before it starts.

    Example:
        >>> events = Events.from_arrays(t=[5, 9], x=[0, 1], y=[2, 2], p=[1, 0], height=4, width=4)
        >>> len(events), len(events.window(5, 9))
        (2, 1)
    """

    t: NDArray[np.int64]
    x: NDArray[np.uint16]
    y: NDArray[np.uint16]
    p: NDArray[np.uint8]
    height: int
    width: int
    span_us: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        """Check everything the rest of the package may then rely on."""
        for name, dtype in FIELDS.items():
            array = getattr(self, name)
            if not isinstance(array, np.ndarray) or array.dtype != dtype or array.ndim != 1:
                found = getattr(array, "dtype", type(array).__name__)
                raise ValueError(
                    f"Expected events.{name} to be a 1-D {np.dtype(dtype)} array, got {found}; "
                    "use Events.from_arrays to convert"
                )
        lengths = {name: len(getattr(self, name)) for name in FIELDS}
        if len(set(lengths.values())) > 1:
            raise ValueError(f"Expected event fields of one length, got {lengths}")
        if len(self.t):
            self._check_values()
        if self.span_us is not None and self.span_us[0] > self.span_us[1]:
            raise ValueError(
                f"Expected a span that starts before it stops, got {self.span_us[0]} to "
                f"{self.span_us[1]} us; give the time in which the sensor was watching"
            )

    def _check_values(self) -> None:
        step = np.flatnonzero(self.t[1:] < self.t[:-1])
        if len(step):
            at = int(step[0]) + 1
            raise ValueError(
                f"Expected events sorted by time, got {self.t[at]} us after {self.t[at - 1]} us "
                f"at index {at}; {backwards(int(self.t[at - 1]), int(self.t[at]))}"
            )
        x, y, p = int(self.x.max()), int(self.y.max()), int(self.p.max())
        if x >= self.width or y >= self.height:
            raise ValueError(
                f"Expected events inside the {self.width}x{self.height} sensor, got x up to {x} "
                f"and y up to {y}; give the true sensor size"
            )
        if p > 1:
            raise ValueError(f"Expected polarities 0 and 1, got {p}; write 1 for brighter, 0 else")

    @classmethod
    def from_arrays(
        cls,
        t: Iterable[int],
        x: Iterable[int],
        y: Iterable[int],
        p: Iterable[int],
        *,
        height: int,
        width: int,
    ) -> Events:
        """Convert array-likes whose values fit the fields' types.

        Raises:
            ValueError: a value is not a whole number or does not fit its field.
        """
        given = {"t": t, "x": x, "y": y, "p": p}
        fields: dict[str, Any] = {k: as_field(k, np.asarray(v)) for k, v in given.items()}
        return cls(**fields, height=height, width=width)

    @classmethod
    def empty(cls, height: int, width: int) -> Events:
        """A stream without events from a sensor of this size."""
        return cls.from_arrays([], [], [], [], height=height, width=width)

    @classmethod
    def concatenate(cls, streams: Iterable[Events]) -> Events:
        """Join streams of one sensor that follow each other in time.

        Raises:
            ValueError: there is no stream, the sensors differ, or a stream starts before the
                previous one ends.
        """
        parts = list(streams)
        if not parts:
            raise ValueError("Expected at least one stream to concatenate, got none")
        sizes = {(part.height, part.width) for part in parts}
        if len(sizes) > 1:
            raise ValueError(f"Expected streams of one sensor size, got {sorted(sizes)}")
        joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in FIELDS}
        first, last = parts[0].span_us, parts[-1].span_us
        span = (first[0], last[1]) if first and last else None
        return cls(**joined, height=parts[0].height, width=parts[0].width, span_us=span)

    @classmethod
    def load(cls, path: Path | str, height: int | None = None, width: int | None = None) -> Events:
        """Read a whole event file of any kind; the sensor size is needed where it lacks that.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: the file is of no known kind, damaged, or fits several readings.
        """
        from eqs.events.formats import decode, is_dsec
        from eqs.events.hints import Hints
        from eqs.events.reader import EventReader

        if not is_dsec(Path(path)):
            return decode(path, Hints(height=height, width=width)).events(height, width)
        with EventReader(path, height=height, width=width) as reader:
            return reader.read()

    def save(self, path: Path | str) -> None:
        """Write a DSEC HDF5 file; it appears under its name only when it is complete."""
        from eqs.events.writer import EventWriter

        with EventWriter(path, height=self.height, width=self.width) as writer:
            writer.append(self)
            writer.span_us = self.span_us

    def __len__(self) -> int:
        """Number of events."""
        return len(self.t)

    @property
    def extent_us(self) -> tuple[int, int] | None:
        """The span or, where nobody noted it, first event's time to just after the last one's."""
        if self.span_us is None and len(self):
            return int(self.t[0]), int(self.t[-1]) + 1
        return self.span_us

    def window(self, start_us: int, stop_us: int) -> Events:
        """The events with `start_us <= t < stop_us`, as views."""
        first, last = np.searchsorted(self.t, [start_us, stop_us], side="left")
        return self[int(first) : int(last)]

    def __getitem__(self, index: slice) -> Events:
        """The events at a slice of indices, as views, without the span."""
        part = object.__new__(Events)  # a slice of checked events needs no second check
        for name in FIELDS:
            object.__setattr__(part, name, getattr(self, name)[index])
        object.__setattr__(part, "height", self.height)
        object.__setattr__(part, "width", self.width)
        object.__setattr__(part, "span_us", None)
        return part

    def shifted(self, offset_us: int) -> Events:
        """The same stream on a clock that reads `offset_us` more."""
        span = self.span_us and (self.span_us[0] + offset_us, self.span_us[1] + offset_us)
        t = self.t + np.int64(offset_us)
        return replace(self, t=t, span_us=span)
