"""Events in MATLAB files: variables or fields of a structure, or a table of four columns."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from eqs.events.decoded import Decoded
from eqs.events.tables import by_key, by_order, decoded

HDF5_FROM = b"MATLAB 7.3"


def read_matlab(
    path: Path,
    order: str | None = None,
    time_unit: str | None = None,
    first_pixel: int | None = None,
) -> Decoded:
    """Events of a MATLAB file of version 5 or 7.3.

    Convention: polarities of 1 and 2 are those that some programs write for 0 and 1. MATLAB counts
    from one, the programs that write events not always: who begins with pixel 1 says so.

    Args:
        path: the file.
        order: order of the columns of a table.
        time_unit: unit of whole-numbered times.
        first_pixel: number of the first column and row.

    Raises:
        ValueError: it holds no events, is damaged, or fits several readings.
    """
    with path.open("rb") as file:
        newer = file.read(len(HDF5_FROM)) == HDF5_FROM
    arrays = _hdf5_arrays(path) if newer else _variables(path)
    for named in (arrays, *_structures(arrays)):
        rows = {name: np.ravel(value) for name, value in named.items() if _is_row(value)}
        columns = by_key(rows)
        if columns:
            return _decoded(columns, path, time_unit, first_pixel)
    tables = [each for each in arrays.values() if _is_table(each)]
    if len(tables) != 1:
        raise ValueError(
            f"Expected x, y, p and t (or ts), a structure of them or one table of four columns in "
            f"{path}, got {', '.join(arrays) or 'nothing'}; save them so"
        )
    table = tables[0] if tables[0].shape[1] == 4 else tables[0].T
    return _decoded(by_order(table, path, order), path, time_unit, first_pixel)


def _variables(path: Path) -> dict[str, NDArray[Any]]:
    try:
        held = loadmat(path, chars_as_strings=False)
    except (
        MatReadError,
        ValueError,
        TypeError,
        KeyError,
        IndexError,
        OSError,
        EOFError,
        AttributeError,
        NotImplementedError,
        MemoryError,
        OverflowError,
        zlib.error,
    ) as error:
        raise ValueError(
            f"Expected a whole MATLAB file at {path}, got: {error}; save it again"
        ) from error  # fmt: skip
    return {name: value for name, value in held.items() if isinstance(value, np.ndarray)}


def _hdf5_arrays(path: Path) -> dict[str, NDArray[Any]]:
    found: dict[str, NDArray[Any]] = {}
    try:
        with h5py.File(path) as file:
            for place in (file, *(each for each in file.values() if isinstance(each, h5py.Group))):
                held = {n: d[()] for n, d in place.items() if isinstance(d, h5py.Dataset)}
                if by_key(held):
                    return held
                found |= held
    except (OSError, RuntimeError, KeyError) as error:
        raise ValueError(
            f"Expected a whole MATLAB file at {path}, got: {error}; save it again"
        ) from error
    return found


def _structures(arrays: Mapping[str, NDArray[Any]]) -> Iterator[dict[str, NDArray[Any]]]:
    """The fields of every variable that is a structure."""
    for value in arrays.values():
        if value.dtype.names and value.size == 1:
            yield {name: np.asarray(value[name].item()) for name in value.dtype.names}


def _is_row(value: NDArray[Any]) -> bool:
    return value.dtype.kind in "uif" and value.size == max(value.shape, default=1)


def _is_table(value: NDArray[Any]) -> bool:
    return value.dtype.kind in "uif" and value.ndim == 2 and 4 in value.shape and value.size > 4


def _decoded(
    columns: Mapping[str, NDArray[Any]], path: Path, time_unit: str | None, first_pixel: int | None
) -> Decoded:
    if len({len(values) for values in columns.values()}) > 1:
        raise ValueError(
            f"Expected x, y, p and t of one length in {path}, got others; save it again"
        )
    least = min(int(columns[name].min(initial=1)) for name in "xy")
    if first_pixel is None and len(columns["x"]) and least >= 1:
        raise ValueError(
            f"Expected to know whether the first pixel is 0 or 1 in {path}, where none is 0; set "
            "first_pixel"
        )
    first = first_pixel or 0
    placed = {name: columns[name].astype(np.int64) - first for name in "xy"}
    p = columns["p"]
    brighter = p > 1 if set(np.unique(p)) == {1, 2} else p > 0
    plain = {**columns, **placed, "p": brighter.astype(np.uint8)}
    return decoded(plain, path, "a MATLAB file", time_unit)
