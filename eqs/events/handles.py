"""An open event file in the layout of DSEC, checked as far as its events need not be read."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import h5py
import hdf5plugin  # noqa: F401 - teaches HDF5 to decompress blosc
import numpy as np
from numpy.typing import NDArray

from eqs.clock import backwards
from eqs.events.hdf5 import require_stored, whole_hdf5
from eqs.events.stream import FIELDS, as_field

LOOKED_AT_ONCE = 10_000_000  # events
STORED_TYPES = {"t": np.uint32, "x": np.uint16, "y": np.uint16, "p": np.uint8}


class Handles:
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
            for column in (*self.columns.values(), self.file["ms_to_idx"]):
                require_stored(column, path)
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
        except BaseException:
            self.file.close()
            with whole_hdf5(path):  # a chunk that cannot be read
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
