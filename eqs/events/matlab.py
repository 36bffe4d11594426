"""MATLAB files: variables, a struct, or a matrix of events.

Convention: files of Orchard's tools for ATIS data count rows and columns from 1, write a polarity
of 1 for darker and 2 for brighter, and have a struct called TD with microseconds in `ts`. A
polarity of 1 without any 2 is brighter.
"""

from __future__ import annotations

import io
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from eqs.events.decoded import Decoded
from eqs.events.hdf5 import require_stored, whole_hdf5
from eqs.events.hints import Hints
from eqs.events.tables import by_key, by_order, decoded

WITH_HDF5 = b"MATLAB 7.3"
DEEPEST = 4  # structs in structs
HEADER, TAG, COMPRESSED = 128, 8, 15  # of version 5: bytes, and the kind of a variable


def read_matlab(path: Path, hints: Hints) -> Decoded:
    """Events of a MATLAB file of version 5 or 7.3.

    Raises:
        ValueError: it holds no events, or several, is damaged, or fits several orders, units or
            numbers of the first pixel.
    """
    with path.open("rb") as file:
        hdf5 = file.read(len(WITH_HDF5)) == WITH_HDF5
    variables = _variables_of_hdf5(path) if hdf5 else _variables(path)
    structs = [(name, found) for name, each in _structs("", variables) if (found := by_key(each))]
    tables = [each for _, held in _structs("", variables) for each in held.values()]
    tables = [each for each in tables if isinstance(each, np.ndarray) and _is_table(each)]
    if len(structs) + (0 if structs else len(tables)) != 1:
        raise ValueError(
            f"Expected one set of x, y, t and p, or one matrix of four columns, in {path}, got "
            f"{', '.join(sorted(variables)) or 'nothing'}; save the events alone"
        )
    name, columns = (
        structs[0] if structs else ("", by_order(_upright(tables[0]), path, hints.order))
    )
    unit = "us" if name.rpartition(".")[2] == "TD" else None
    columns = _from_zero({key: np.ravel(value) for key, value in columns.items()}, path, hints)
    return decoded(columns, path, "a MATLAB file", hints.time_unit or unit)


def _variables(path: Path) -> dict[str, Any]:
    """Variables of version 5, structs as dictionaries."""
    from scipy.io import loadmat

    try:
        unpacked: Any = _unpacked(path.read_bytes())
        found = loadmat(unpacked, simplify_cells=True)
    except Exception as error:  # the library raises whatever damage leads it to
        raise ValueError(f"Expected a whole MATLAB file at {path}, got: {error}") from error
    return {name: value for name, value in found.items() if not name.startswith("__")}


def _unpacked(content: bytes) -> io.BytesIO:
    """The file with its compressed variables unpacked.

    From those the library takes as much memory as they say they need, damaged or not.
    """
    order: Literal["little", "big"] = "little" if content[126:128] == b"IM" else "big"
    parts, at = [content[:HEADER]], HEADER
    while at + TAG <= len(content):
        kind, size = (int.from_bytes(content[at + k : at + k + 4], order) for k in (0, 4))
        body = content[at : at + TAG + size]
        parts.append(zlib.decompress(body[TAG:]) if kind == COMPRESSED else body)
        at += TAG + size
    return io.BytesIO(b"".join(parts))


def _variables_of_hdf5(path: Path) -> dict[str, Any]:
    """Variables of version 7.3, which stores the transpose of each."""
    with whole_hdf5(path), h5py.File(path) as file:
        return _held(file, path)


def _held(group: h5py.Group, path: Path) -> dict[str, Any]:
    held: dict[str, Any] = {}
    for name, each in group.items():
        if isinstance(each, h5py.Group) and not name.startswith("#"):
            held[name] = _held(each, path)
        elif isinstance(each, h5py.Dataset) and each.dtype.kind in "iufb":
            require_stored(each, path)
            held[name] = each[()].T
    return held


def _structs(name: str, held: Mapping[str, Any], depth: int = 0) -> Iterator[tuple[str, Any]]:
    """A struct's numbers, and those of the structs in it, by name."""
    yield name, {key: value for key, value in held.items() if _is_numbers(value)}
    for key, value in held.items():
        if isinstance(value, Mapping) and depth < DEEPEST:
            yield from _structs(f"{name}.{key}", value, depth + 1)


def _is_numbers(value: object) -> bool:
    return isinstance(value, np.ndarray | np.number) and np.asarray(value).dtype.kind in "iufb"


def _is_table(value: NDArray[Any]) -> bool:
    return value.ndim == 2 and 4 in value.shape


def _upright(table: NDArray[Any]) -> NDArray[Any]:
    return table if table.shape[1] == 4 else table.T


def _from_zero(
    columns: Mapping[str, NDArray[Any]], path: Path, hints: Hints
) -> dict[str, NDArray[Any]]:
    """Columns with polarities of 0 and 1 and pixels that count from 0."""
    found = {
        name: values.astype(values.dtype.newbyteorder("=")) for name, values in columns.items()
    }
    twos = len(found["p"]) > 0 and found["p"].max() == 2 and found["p"].min() >= 1
    if twos:
        found["p"] = found["p"] - 1
    first = hints.first_pixel
    if first is None:
        first = _first_pixel(found["x"], found["y"], path, hints, twos=twos)
    if first:
        found["x"], found["y"] = (found[name].astype(np.int64) - first for name in "xy")
    return found


def _first_pixel(x: NDArray[Any], y: NDArray[Any], path: Path, hints: Hints, *, twos: bool) -> int:
    """What the first row and column are called, 0 or 1."""
    if not len(x) or not len(y) or min(x.min(), y.min()) <= 0:
        return 0
    if twos or x.max() == hints.width or y.max() == hints.height:
        return 1
    raise ValueError(
        f"Expected to know whether rows and columns in {path} count from 0 or from 1, got columns "
        f"from {x.min():.0f} and rows from {y.min():.0f}; set first_pixel=0 or 1"
    )
