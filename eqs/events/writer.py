"""Writes event files in the layout of DSEC, piece by piece."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

import h5py
import hdf5plugin
import numpy as np
from numpy.typing import NDArray

from eqs.clock import backwards
from eqs.events.handles import STORED_TYPES
from eqs.events.stream import Events
from eqs.files import complete_file

# Windows of some ten thousand events read fastest from chunks of this length: larger chunks are
# decompressed in vain, smaller ones cost a call each.
CHUNK_EVENTS = 32768
LONGEST_US = int(np.iinfo(np.uint32).max)


class EventWriter:
    """Writes one event file, piece by piece; it gets its name only when it is complete.

    Until then it has a temporary name, and an exception inside the `with` block removes it.
    The same events give the same file however they are cut into pieces.

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
        self._pending: list[Events] = []
        self._pending_count = 0

    def __enter__(self) -> Self:
        """Begin the file under its temporary name."""
        self._naming = complete_file(self.path)
        self._file = h5py.File(self._naming.__enter__(), "w")
        self._file.attrs.update(height=self.height, width=self.width)
        for name, dtype in STORED_TYPES.items():
            self._file.create_dataset(
                f"events/{name}",
                shape=(0,),
                maxshape=(None,),
                chunks=(CHUNK_EVENTS,),
                dtype=dtype,
                **hdf5plugin.Blosc(cname="zstd", clevel=1, shuffle=hdf5plugin.Blosc.SHUFFLE),
            )
        self._next_ms = 1
        return self

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
        self._flush()
        index = np.concatenate(self._index).astype(np.uint64)
        self._file.create_dataset("ms_to_idx", data=index)
        self._file.create_dataset("t_offset", data=np.int64(self._offset_us or 0))
        if self.span_us is not None:
            self._file.attrs.update(start_us=self.span_us[0], stop_us=self.span_us[1])

    def append(self, events: Events) -> None:
        """Add events that follow those already given.

        Raises:
            ValueError: the sensor differs, time runs backwards or is negative, or the recording
                grows longer than the layout's 32-bit times can count (71 minutes).
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
            self._flush()

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

    def _flush(self) -> None:
        if not self._pending:
            return
        part = Events.concatenate(self._pending)
        relative = part.t - np.int64(self._offset_us or 0)
        self._extend_index(relative)
        stop = self._count + len(part)
        for name in STORED_TYPES:
            values = relative.astype(np.uint32) if name == "t" else getattr(part, name)
            self._file[f"events/{name}"].resize((stop,))
            self._file[f"events/{name}"][self._count : stop] = values
        self._count, self._pending, self._pending_count = stop, [], 0

    def _extend_index(self, relative_us: NDArray[np.int64]) -> None:
        stop_ms = int(relative_us[-1]) // 1000 + 1
        edges_us = np.arange(self._next_ms, stop_ms, dtype=np.int64) * 1000
        self._index.append(self._count + np.searchsorted(relative_us, edges_us, side="left"))
        self._next_ms = max(self._next_ms, stop_ms)
