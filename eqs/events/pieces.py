"""Any event file in pieces that follow each other in time, so that memory stays small."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.events.decoded import Decoded
from eqs.events.formats import decode, is_dsec
from eqs.events.raw import raw_pieces
from eqs.events.reader import EventReader
from eqs.events.stream import FIELDS, Events

WINDOW_US = 1_000_000  # of a file in the layout of DSEC
LATE_US = 1_000_000  # so much younger may an event be than one that comes after it


@dataclass(frozen=True, kw_only=True)
class ReadAs:
    """What an event file does not say of itself.

    Args:
        height: rows of the sensor.
        width: columns of the sensor.
        order: order of the columns of a table, for instance `txyp`.
        time_unit: unit of whole-numbered times in a table: s, ms, us or ns.
        first_pixel: number of the first column and row in a MATLAB file, 0 or 1.
    """

    height: int | None = None
    width: int | None = None
    order: str | None = None
    time_unit: str | None = None
    first_pixel: int | None = None


class EventPieces:
    """The events of a file, sorted by time as a whole, piece by piece.

    Files in the layout of DSEC and RAW files are read in pieces, others whole. How many events came
    after a later one (`disorder`) or had no time yet (`dropped`) is known after the last piece.

    Args:
        path: an event file of any kind.
        read_as: what it does not say of itself.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it cannot be read, or nobody says its sensor's size.
    """

    def __init__(self, path: Path, read_as: ReadAs | None = None) -> None:
        """Open the file; events are read when they are asked for."""
        given = read_as or ReadAs()
        self.path, self.disorder, self.dropped = path, 0, 0
        self.span_us: tuple[int, int] | None = None
        self._reader: EventReader | None = None
        self._decoded: Iterator[Decoded] = iter(())
        if is_dsec(path):
            with EventReader(path, given.height, given.width) as reader:
                self._reader, self.span_us = reader, reader.span_us
                self.kind = "HDF5 in the layout of DSEC"
                self.height, self.width = reader.height, reader.width
            return
        pieces = raw_pieces(path)
        if pieces is None:
            pieces = iter((decode(path, given.order, given.time_unit, given.first_pixel),))
        first = next(pieces)
        self.kind = first.kind
        self.height, self.width = first.size(given.height, given.width)
        self._decoded = _all_of(first, pieces)

    def __iter__(self) -> Iterator[Events]:
        """The pieces, of which none is empty.

        Raises:
            ValueError: an event is outside the sensor, or comes too late to be put in order.
        """
        if self._reader is None:
            return self._sorted()
        return self._windows(self._reader)

    def _windows(self, reader: EventReader) -> Iterator[Events]:
        with reader:
            for start in range(reader.start_us, reader.stop_us, WINDOW_US):
                events = reader.window(start, start + WINDOW_US)
                if len(events):
                    yield events

    def _sorted(self) -> Iterator[Events]:
        """Sort what has come; the youngest waits for the next piece, which may hold older ones."""
        waiting: dict[str, NDArray[Any]] = {name: np.empty(0, np.int64) for name in FIELDS}
        newest = done = np.iinfo(np.int64).min
        for piece in self._decoded:
            self.dropped += piece.dropped
            self.disorder += piece.disorder_after(newest)
            if not len(piece.t):
                continue
            newest = max(newest, int(piece.t.max()))
            fields = {n: np.concatenate([waiting[n], getattr(piece, n)]) for n in FIELDS}
            order = np.argsort(fields["t"], kind="stable")
            fields = {name: values[order] for name, values in fields.items()}
            if fields["t"][0] < done:
                raise ValueError(
                    f"Expected events at most {LATE_US} us after younger ones in {self.path}, got "
                    f"{fields['t'][0]} us after {newest} us; sort the file first"
                )
            ready = int(np.searchsorted(fields["t"], newest - LATE_US))
            if ready:
                done = int(fields["t"][ready - 1])
                yield self._events({name: values[:ready] for name, values in fields.items()})
            waiting = {name: values[ready:] for name, values in fields.items()}
        if len(waiting["t"]):
            yield self._events(waiting)

    def _events(self, fields: dict[str, NDArray[Any]]) -> Events:
        return Events.from_arrays(**fields, height=self.height, width=self.width)


def _all_of(first: Decoded, others: Iterator[Decoded]) -> Iterator[Decoded]:
    yield first
    yield from others
