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

import numpy as np

from eqs.events.handles import Handles
from eqs.events.stream import FIELDS, Events, as_field


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
        self._handles: Handles | None = None

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

    def cuts_us(self, events: int) -> list[int]:
        """Times that cut the file into pieces of about so many events, at whole milliseconds."""
        file = self._opened()
        wanted = np.arange(events, file.count, events)
        found = 1000 * np.unique(np.searchsorted(file.index, wanted)) + file.offset_us
        inside = found[(found > file.start_us) & (found < file.stop_us)]
        return [file.start_us, *inside.tolist(), file.stop_us]

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
        except (OSError, RuntimeError) as error:  # a chunk that cannot be read
            raise ValueError(
                f"Expected a whole HDF5 file at {self.path}, got: {error}; replace the damaged file"
            ) from error
        except ValueError as error:
            raise ValueError(f"{self.path}: {error}") from error
        return events if self.height == file.height else _top_rows(events, self.height)

    def _opened(self) -> Handles:
        if self._handles is None or self._handles.process != os.getpid():
            self._handles = Handles(self.path, *self._size)
        return self._handles


def _top_rows(events: Events, rows: int) -> Events:
    """The events above a row, on a sensor that ends there."""
    keep = events.y < rows
    fields = {name: getattr(events, name)[keep] for name in FIELDS}
    return Events(**fields, height=rows, width=events.width)
