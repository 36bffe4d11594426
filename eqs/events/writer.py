"""Writes event files in the layout of DSEC, piece by piece."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import h5py
import hdf5plugin
import numpy as np
from numpy.typing import DTypeLike, NDArray

from eqs.clock import backwards
from eqs.events.handles import STORED_TYPES
from eqs.events.stream import Events
from eqs.files import complete_file

# Windows of some ten thousand events read fastest from chunks of this length: larger chunks are
# decompressed in vain, smaller ones cost a call each.
CHUNK_EVENTS = 32768
COPIED_AT_ONCE = 64 * CHUNK_EVENTS
NARROW_US = int(np.iinfo(np.uint32).max)  # what the times of DSEC can count: 71 minutes
LONGEST_US = 24 * 3600 * 1_000_000  # the index has an entry for every millisecond

log = logging.getLogger(__name__)


class EventWriter:
    """Writes one event file, piece by piece; it gets its name only when it is complete.

    Until then it has a temporary name, and an exception inside the `with` block removes it.
    The same events give the same file however they are cut into pieces. Times beyond 71 minutes
    take 64 bits, which is said, since programs that go by DSEC's 32 do not read them.

    Args:
        path: where the file will be; its folder is made if need be.
        height: rows of the sensor.
        width: columns of the sensor.
        t_offset_us: time from which the stored times count; by default that of the first event.

    Raises:
        ValueError: the times count from one below zero.

    Example:
        >>> import tempfile
        >>> from eqs.events import EventReader
        >>> folder = tempfile.TemporaryDirectory()
        >>> path = Path(folder.name) / "events.h5"
        >>> events = Events.from_arrays(t=[7, 9], x=[1, 2], y=[0, 0], p=[1, 0], height=4, width=4)
        >>> with EventWriter(path, height=4, width=4) as writer:
        ...     writer.append(events)
        >>> with EventReader(path) as reader:
        ...     reader.start_us, reader.stop_us, len(reader.window(8, 10))
        (7, 10, 1)
        >>> folder.cleanup()
    """

    def __init__(
        self, path: Path | str, height: int, width: int, t_offset_us: int | None = None
    ) -> None:
        """Remember the file's name; nothing is created yet."""
        self.path = Path(path)
        if t_offset_us is not None and t_offset_us < 0:
            raise ValueError(
                f"Expected a clip that begins at zero or later for {self.path}, got {t_offset_us} "
                f"us; add {-t_offset_us} to all times"
            )
        self.height, self.width = height, width
        self.span_us: tuple[int, int] | None = None
        """Start and stop of the time that was watched, which may be set until the file is whole."""
        self._offset_us = t_offset_us
        self._index = [np.zeros(1, np.int64)]  # entries of ms_to_idx; the first is 0 by definition
        self._last_us = -1
        self._count = self._next_ms = 0
        self._columns: dict[str, h5py.Dataset] = {}
        self._pending: list[Events] = []
        self._pending_count = 0

    def __enter__(self) -> Self:
        """Begin the file under its temporary name."""
        self._naming = complete_file(self.path)
        self._file = h5py.File(self._naming.__enter__(), "w")
        self._file.attrs.update(height=self.height, width=self.width)
        for name, dtype in STORED_TYPES.items():
            self._columns[name] = self._create(name, dtype)
        self._next_ms = 1
        return self

    def _create(self, name: str, dtype: DTypeLike) -> h5py.Dataset:
        return self._file.create_dataset(
            f"events/{name}",
            shape=(0,),
            maxshape=(None,),
            chunks=(CHUNK_EVENTS,),
            dtype=dtype,
            **hdf5plugin.Blosc(cname="zstd", clevel=1, shuffle=hdf5plugin.Blosc.SHUFFLE),
        )

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Complete the file and give it its name, or remove it after an exception."""
        with ExitStack() as stack:
            stack.push(self._naming)  # what goes wrong below is told to it as well
            with self._file:
                if error is not None:
                    raise error
                self._complete()

    def _complete(self) -> None:
        self._flush(self._pending_count)
        index = np.concatenate(self._index).astype(np.uint64)
        self._file.create_dataset("ms_to_idx", data=index)
        self._file.create_dataset("t_offset", data=np.int64(self._offset_us or 0))
        if self.span_us is not None:
            self._file.attrs.update(start_us=self.span_us[0], stop_us=self.span_us[1])

    def append(self, events: Events) -> None:
        """Add events that follow those already given.

        Raises:
            ValueError: the sensor differs, time runs backwards or is negative, or the recording
                grows longer than a day.
        """
        self._check(events)
        if len(events) == 0:
            return
        if self._offset_us is None:
            self._offset_us = int(events.t[0])
        self._last_us = int(events.t[-1])
        self._pending.append(events)
        self._pending_count += len(events)
        if self._pending_count >= CHUNK_EVENTS:
            self._flush(self._pending_count // CHUNK_EVENTS * CHUNK_EVENTS)

    def _check(self, events: Events) -> None:
        if (events.height, events.width) != (self.height, self.width):
            raise ValueError(
                f"Expected events of a {self.width}x{self.height} sensor for {self.path}, got "
                f"{events.width}x{events.height}; give the writer the stream's size"
            )
        if len(events) == 0:
            return
        first, last = int(events.t[0]), int(events.t[-1])
        if first < 0:
            raise ValueError(
                f"Expected times of zero or more for {self.path}, got {first} us; add {-first} to "
                "all of them, frames and labels alike"
            )
        earliest = max(self._last_us, self._offset_us or 0)
        if first < earliest:
            raise ValueError(
                f"Expected events at or after {earliest} us for {self.path}, got {first} us; "
                f"append streams in time order, from the given offset on, or "
                f"{backwards(earliest, first)}"
            )
        offset = first if self._offset_us is None else self._offset_us
        if last - offset > LONGEST_US:
            raise ValueError(
                f"Expected a recording of at most {LONGEST_US} us for {self.path}, got "
                f"{last - offset} us; split it"
            )

    def _flush(self, count: int) -> None:
        """Write so many of the pending events, a chunk of the file at a time."""
        if not count:
            return
        pending = Events.concatenate(self._pending)
        columns = {name: getattr(pending, name)[:count] for name in STORED_TYPES}
        columns["t"] = columns["t"] - np.int64(self._offset_us or 0)
        self._extend_index(columns["t"])
        # Chunk after chunk of all columns, so that the file does not tell where pieces ended.
        for first in range(0, count, CHUNK_EVENTS):
            self._write(
                {name: each[first : first + CHUNK_EVENTS] for name, each in columns.items()}
            )
        self._pending, self._pending_count = [pending[count:]], len(pending) - count

    def _write(self, part: Mapping[str, NDArray[Any]]) -> None:
        """Write a chunk of the file, or its last piece."""
        if part["t"][-1] > NARROW_US:
            self._widen()
        for name, values in part.items():
            extend(self._columns[name], values)
        self._count += len(part["t"])

    def _widen(self) -> None:
        """Go on with times of 64 bits."""
        narrow = self._columns["t"]
        if narrow.dtype == np.uint64:
            return
        log.warning(
            "%s is longer than 71 minutes: its times take 64 bits, which programs that go by "
            "DSEC's 32 do not read",
            self.path,
        )
        self._file.move("events/t", "narrow")
        wide = self._create("t", np.uint64)
        wide.resize((self._count,))
        for first in range(0, self._count, COPIED_AT_ONCE):
            last = min(first + COPIED_AT_ONCE, self._count)
            wide[first:last] = narrow[first:last].astype(np.uint64)
        del self._file["narrow"]
        self._columns["t"] = wide

    def _extend_index(self, relative_us: NDArray[np.int64]) -> None:
        stop_ms = int(relative_us[-1]) // 1000 + 1
        edges_us = np.arange(self._next_ms, stop_ms, dtype=np.int64) * 1000
        self._index.append(self._count + np.searchsorted(relative_us, edges_us, side="left"))
        self._next_ms = max(self._next_ms, stop_ms)


def extend(column: h5py.Dataset, values: NDArray[Any]) -> None:
    """Write values behind those of a column, without the high-level interface's cost per call."""
    count, values = len(column), np.ascontiguousarray(values, column.dtype)
    column.id.set_extent((count + len(values),))
    space = column.id.get_space()
    space.select_hyperslab((count,), (len(values),))
    column.id.write(h5py.h5s.create_simple((len(values),)), space, values)
