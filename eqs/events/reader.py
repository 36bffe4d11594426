"""Reads event files in the layout of DSEC: HDF5 with a coarse millisecond index.

A file holds `events/{x,y,p,t}`, the time of each event counted from the scalar `t_offset`, and
`ms_to_idx`, whose entry k is the index of the first event at or after k milliseconds. Files written
here also carry the sensor size as attributes `height` and `width` and, where it is known, the span
that was watched as `start_us` and `stop_us`, which DSEC's own files lack.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import h5py
import hdf5plugin  # noqa: F401 - teaches HDF5 to decompress blosc
import numpy as np
from numpy.typing import NDArray

from eqs.clock import backwards
from eqs.events.stream import FIELDS, Events, as_field

LOOKED_AT_ONCE = 10_000_000  # events
STORED_TYPES = {"t": np.uint32, "x": np.uint16, "y": np.uint16, "p": np.uint8}


class EventReader:
    """Reads windows of one event file without loading the rest of it.

    The file is opened at the first use and its dataset handles are kept, since HDF5's chunk cache
    lives as long as they do. A pickled copy, or a copy in a forked process, opens the file anew.

    Args:
        path: file in the layout of DSEC.
        height: rows of the sensor; needed where the file does not carry them.
        width: columns of the sensor; needed where the file does not carry them.
        rows: number of rows, counted from the top, to keep; the stream then looks like that of a
            sensor with so many rows, except that `len` counts all events. All rows if None.

    Raises:
        FileNotFoundError: there is no such file (at the first use).
        ValueError: the file is truncated, lacks a dataset, holds something other than sorted events
            of this sensor, or states another sensor size (at the first use or the first window
            that meets the fault).
    """

    def __init__(
        self,
        path: Path | str,
        height: int | None = None,
        width: int | None = None,
        rows: int | None = None,
    ) -> None:
        """Remember the file; nothing is opened yet."""
        self.path = Path(path)
        self.rows = rows
        self._size = (height, width)
        self._handles: _Handles | None = None

    def __enter__(self) -> Self:
        """Open the file."""
        self._opened()
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self.close()

    def close(self) -> None:
        """Close the file; the next use opens it again."""
        if self._handles is not None and self._handles.process == os.getpid():
            self._handles.file.close()
        self._handles = None

    def __getstate__(self) -> dict[str, Any]:
        """Leave the handles behind: they mean nothing in another process."""
        return {**self.__dict__, "_handles": None}

    @property
    def height(self) -> int:
        """Rows of the sensor that are kept."""
        height = self._opened().height
        return height if self.rows is None else min(self.rows, height)

    @property
    def width(self) -> int:
        """Columns of the sensor."""
        return self._opened().width

    @property
    def start_us(self) -> int:
        """Time of the first event; the file's offset if there is none."""
        return self._opened().start_us

    @property
    def stop_us(self) -> int:
        """One microsecond past the last event; the file's offset if there is none."""
        return self._opened().stop_us

    @property
    def span_us(self) -> tuple[int, int] | None:
        """Start and stop of the time that was watched; None where the file does not say."""
        return self._opened().span_us

    @property
    def extent_us(self) -> tuple[int, int] | None:
        """The span or, where the file says none, that of the events; None without either."""
        return self.span_us or ((self.start_us, self.stop_us) if len(self) else None)

    def longest_silence_us(self) -> int:
        """The longest time between two events, in whole milliseconds of the file's index."""
        changes = np.flatnonzero(np.diff(self._opened().index))
        return 1000 * int(np.diff(changes).max(initial=1) - 1)

    def __len__(self) -> int:
        """Number of events in the file."""
        return self._opened().count

    def read(self) -> Events:
        """All events at once, with the span that the file states."""
        return replace(self.window(self.start_us, self.stop_us), span_us=self.span_us)

    def window(self, start_us: int, stop_us: int) -> Events:
        """The events with `start_us <= t < stop_us`; none where the recording has none.

        Raises:
            ValueError: an event met on the way is out of order or outside the sensor.
        """
        file = self._opened()
        start_us, stop_us = max(start_us, file.start_us), min(stop_us, file.stop_us)
        if start_us >= stop_us:
            return Events.empty(self.height, file.width)
        try:
            first, t = file.times(start_us - file.offset_us, stop_us - file.offset_us)
            rows = slice(first, first + len(t))
            fields: dict[str, Any] = {k: as_field(k, file.columns[k][rows]) for k in "xyp"}
            events = Events(t + file.offset_us, **fields, height=file.height, width=file.width)
        except (OSError, ValueError) as error:
            raise ValueError(f"{self.path}: {error}") from error
        return events if self.height == file.height else _top_rows(events, self.height)

    def _opened(self) -> _Handles:
        if self._handles is None or self._handles.process != os.getpid():
            self._handles = _Handles(self.path, *self._size)
        return self._handles


class _Handles:
    """An open event file, checked as far as is possible without reading its events."""

    def __init__(self, path: Path, height: int | None, width: int | None) -> None:
        """Open and check the file."""
        self.process = os.getpid()
        self.file = _open_hdf5(path)
        try:
            self._check_layout(path)
            self.columns = {name: self.file[f"events/{name}"] for name in FIELDS}
            self._check_columns(path)
            self.count = len(self.columns["t"])
            self.offset_us = 0
            if "t_offset" in self.file:
                self.offset_us = _whole_number(self.file["t_offset"], f"t_offset in {path}")
            self.index = self.file["ms_to_idx"][:].astype(np.int64)
            self._check_index(path)
            self.height = self._side(path, "height", height)
            self.width = self._side(path, "width", width)
            self.start_us = self.stop_us = self.offset_us
            if self.count:
                self.start_us += int(self.columns["t"][0])
                self.stop_us += int(self.columns["t"][-1]) + 1
            self._check_times(path)
            self.span_us = self._span(path)
        except BaseException as error:
            self.file.close()
            if isinstance(error, OSError):  # a chunk that cannot be read
                raise ValueError(f"{path}: {error}; replace the damaged file") from error
            raise

    def times(self, start: int, stop: int) -> tuple[int, NDArray[np.int64]]:
        """Index of the first event in [start, stop) and the times of all of them.

        The index brackets the window to whole milliseconds, a search inside the bracket makes it
        exact. One event more is read on either side, which shows an index that brackets too
        little. Times count from the offset.
        """
        first_ms, stop_ms = start // 1000, -(-stop // 1000)
        low = max(int(self.index[min(first_ms, len(self.index) - 1)]) - 1, 0)
        high = self.count if stop_ms >= len(self.index) else int(self.index[stop_ms]) + 1
        high = min(high, self.count)
        t = as_field("t", self.columns["t"][low:high])
        back = np.flatnonzero(t[1:] < t[:-1])
        if len(back):
            before, after = int(t[back[0]]), int(t[back[0] + 1])
            raise ValueError(
                f"expected events sorted by time, got {after} us after {before} us at event "
                f"{low + int(back[0]) + 1}; {backwards(before, after)} and write the file again"
            )
        first, last = np.searchsorted(t, [start, stop], side="left")
        if (first == 0 and low > 0) or (last == len(t) and high < self.count):
            raise ValueError(
                f"expected ms_to_idx to agree with events/t, got events outside their millisecond "
                f"near event {low} or event {high}; write the file again"
            )
        return int(low + first), t[first:last]

    def _check_layout(self, path: Path) -> None:
        needed = [f"events/{name}" for name in "xypt"] + ["ms_to_idx"]
        missing = [name for name in needed if not isinstance(self.file.get(name), h5py.Dataset)]
        if missing:
            raise ValueError(
                f"Expected {path} to have the layout of DSEC, got a file without "
                f"{', '.join(missing)}; convert it to events/{{x,y,p,t}}, ms_to_idx and t_offset"
            )

    def _check_columns(self, path: Path) -> None:
        stored = {f"events/{name}": STORED_TYPES[name] for name in self.columns}
        for name, dtype in {**stored, "ms_to_idx": np.uint64}.items():
            column = self.file[name]
            if column.ndim != 1 or column.dtype.kind not in "uib":
                raise ValueError(
                    f"Expected {name} in {path} to be a row of whole numbers, got "
                    f"{column.dtype} of shape {column.shape}; convert it to {np.dtype(dtype)}"
                )
        lengths = {name: len(column) for name, column in self.columns.items()}
        if len(set(lengths.values())) > 1:
            raise ValueError(
                f"Expected event fields of one length in {path}, got {lengths}; "
                "write the file again"
            )

    def _check_index(self, path: Path) -> None:
        index = self.index
        sound = len(index) and index[0] == 0 and index[-1] <= self.count
        if self.count and not (sound and np.all(index[1:] >= index[:-1])):
            raise ValueError(
                f"Expected ms_to_idx in {path} to rise from 0 to at most {self.count}, got another "
                "row of numbers; sort the stream and write the file again"
            )

    def _check_times(self, path: Path) -> None:
        if self.count and min(self.start_us, self.start_us - self.offset_us) < 0:
            raise ValueError(
                f"Expected times of zero or more in {path}, got {self.start_us} us for the first "
                f"event ({self.start_us - self.offset_us} in events/t, {self.offset_us} in "
                "t_offset); shift the stream and write the file again"
            )
        if self.stop_us < self.start_us:
            raise ValueError(
                f"Expected events sorted by time in {path}, got the last event at "
                f"{self.stop_us - 1} us, before the first at {self.start_us} us; "
                f"{self._advice()} and write the file again"
            )

    def _advice(self) -> str:
        """What to do about the first time that falls."""
        for start in range(0, self.count - 1, LOOKED_AT_ONCE):
            t = self.columns["t"][start : start + LOOKED_AT_ONCE + 1].astype(np.int64)
            falls = np.flatnonzero(np.diff(t) < 0)
            if len(falls):
                return backwards(int(t[falls[0]]), int(t[falls[0] + 1]))
        return "sort the stream"

    def _span(self, path: Path) -> tuple[int, int] | None:
        limits = [self.file.attrs.get(name) for name in ("start_us", "stop_us")]
        if any(limit is None for limit in limits):
            return None
        start, stop = (_whole_number(limit, f"the span of {path}") for limit in limits)
        return start, stop

    def _side(self, path: Path, name: str, given: int | None) -> int:
        stored = self.file.attrs.get(name)
        if stored is not None:
            stored = _whole_number(stored, f"the attribute {name} of {path}")
        if stored is None and given is None:
            raise ValueError(
                f"Expected the sensor's {name} for {path}, which does not carry it; pass {name}= "
                "or set data.size"
            )
        if stored is not None and given is not None and stored != given:
            raise ValueError(
                f"Expected a sensor with {name} {given}, got {stored} in {path}; "
                "set data.size to the size of the recording"
            )
        return stored if given is None else given


def _top_rows(events: Events, rows: int) -> Events:
    """The events above a row, on a sensor that ends there."""
    keep = events.y < rows
    fields = {name: getattr(events, name)[keep] for name in FIELDS}
    return Events(**fields, height=rows, width=events.width)


def _whole_number(node: Any, what: str) -> int:  # noqa: ANN401 - whatever a file holds
    """The number in a dataset or attribute that holds one."""
    value = np.asarray(node[()] if isinstance(node, h5py.Dataset) else node)
    if isinstance(node, h5py.Group) or value.size != 1 or value.dtype.kind not in "ui":
        raise ValueError(
            f"Expected {what} to be one whole number, got {value.dtype} of shape {value.shape}; "
            "write the file again"
        )
    return int(value.item())


def _open_hdf5(path: Path) -> h5py.File:
    if not path.is_file():
        raise FileNotFoundError(
            f"Expected an event file at {path}, found none; check data.root, or make the file first"
        )
    try:
        return h5py.File(path, "r")
    except OSError as error:
        raise ValueError(
            f"Expected {path} to be a whole HDF5 file, got one that cannot be opened ({error}); "
            "replace the truncated or foreign file"
        ) from error
