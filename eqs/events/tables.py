"""Events as tables: npy and npz, and the HDF5 files of other programs."""

from __future__ import annotations

import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np
from numpy.lib import format as headers
from numpy.typing import NDArray

from eqs.events.decoded import Decoded
from eqs.events.hdf5 import require_stored, whole_hdf5
from eqs.events.hints import UNITS_US, Hints

NAMES = {
    "t": ("t", "ts", "time", "timestamp", "timestamps"),
    "x": ("x", "xs", "col", "column"),
    "y": ("y", "ys", "row"),
    "p": ("p", "ps", "pol", "polarity", "polarities", "on"),
}
ORDERS = ("txyp", "xytp", "xypt", "tpxy", "pxyt")
# Where programs put their events: a dataset of four columns in a known order and unit, or a group.
COLUMNS = {"davis/left/events": ("xytp", "s"), "events": ("txyp", "us")}
GROUPS = ("prophesee/left", "events", "CD/events")
ECF = 36559
ZIP = b"PK\x03\x04"
# What reading a zip may raise where the file does not hold what it says.
DAMAGED_ARRAY = (ValueError, OSError, SyntaxError, TypeError, tokenize.TokenError)
DAMAGED_ZIP = (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, OSError)
LATEST_US, LAST_PIXEL = 1 << 62, (1 << 16) - 1
LISTED = 8
Held = TypeVar("Held")


def read_numpy(path: Path, hints: Hints) -> Decoded:
    """Events of an npy or npz file: four columns, named fields, or an array for each.

    Raises:
        ValueError: it holds something else, or fits several orders or units.
    """
    with path.open("rb") as file:
        zipped = file.read(len(ZIP)) == ZIP
    try:
        found: Any = _arrays(path) if zipped else np.load(path, "r", allow_pickle=False)
    except (
        *DAMAGED_ZIP,
        ValueError,
        OSError,
        SyntaxError,
        TypeError,
        tokenize.TokenError,
    ) as error:
        raise ValueError(f"Expected arrays of events in {path}, got: {error}") from error
    if zipped:
        named = by_key(found)
        if named:
            return decoded(named, path, "an npz file", hints.time_unit)
        tables = [each for each in found.values() if each.ndim == 2 or each.dtype.names]
        if len(tables) != 1:
            raise ValueError(f"Expected one table of events in {path}, got {sorted(found)}")
        found = tables[0]
    if found.dtype.names:
        named = by_key({name: found[name] for name in found.dtype.names})
        if named:
            return decoded(named, path, "a numpy file", hints.time_unit)
    if found.ndim != 2 or found.shape[1] != 4:
        raise ValueError(
            f"Expected events in four columns or named fields in {path}, got {found.dtype} of "
            f"shape {found.shape}"
        )
    columns = by_order(found, path, hints.order)
    return decoded(columns, path, "a numpy file", hints.time_unit)


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of an npz file, each no larger than what is stored of it."""
    arrays = {}
    with zipfile.ZipFile(path) as archive:
        for info in archive.infolist():
            with archive.open(info) as member:
                version = headers.read_magic(member)
                first = version == (1, 0)
                read = headers.read_array_header_1_0 if first else headers.read_array_header_2_0
                shape, _, kind = read(member)
                if prod(shape) * kind.itemsize > info.file_size:
                    raise ValueError(f"{info.filename} says more than it holds")
            with archive.open(info) as member:
                name = info.filename.removesuffix(".npy")
                arrays[name] = headers.read_array(member, allow_pickle=False)
    return arrays


def read_foreign_hdf5(path: Path, hints: Hints) -> Decoded:
    """Events of an HDF5 file of v2e, MVSEC, event_utils, M3ED or Metavision.

    Raises:
        ValueError: it is none of these, or compressed by a filter that cannot be had.
    """
    with whole_hdf5(path), h5py.File(path) as file:
        for place, (order, unit) in COLUMNS.items():
            found = file.get(place)
            if isinstance(found, h5py.Dataset) and found.ndim == 2 and found.shape[1] == 4:
                require_stored(found, path)
                columns = dict(zip(order, found[:].T, strict=True))
                return decoded(columns, path, f"an HDF5 file ({place})", hints.time_unit or unit)
        for place in GROUPS:
            named = by_key(_columns(file.get(place), path))
            if named:
                unit = "s" if named["t"].dtype.kind == "f" else "us"
                return decoded(named, path, f"an HDF5 file ({place})", hints.time_unit or unit)
        held: list[str] = []
        file.visititems(
            lambda name, each: held.append(name) if isinstance(each, h5py.Dataset) else None
        )
        shown = ", ".join(held[:LISTED]) or "nothing"
    raise ValueError(
        f"Expected the events of DSEC (events/x, y, p, t and ms_to_idx), v2e, MVSEC, "
        f"event_utils, M3ED or Metavision in {path}, got {shown}; convert it"
    )


def _columns(found: object, path: Path) -> dict[str, NDArray[Any]]:
    """The rows of numbers in a group, or the fields of a table."""
    if isinstance(found, h5py.Dataset) and found.dtype.names:
        _require_filter(found, path)
        require_stored(found, path)
        table = found[:]
        return {name: table[name] for name in table.dtype.names}
    if not isinstance(found, h5py.Group):
        return {}
    rows = {
        name: each
        for name, each in found.items()
        if isinstance(each, h5py.Dataset) and each.ndim == 1
    }
    for each in rows.values():
        require_stored(each, path)
    return {name: each[:] for name, each in rows.items()}


def _require_filter(dataset: h5py.Dataset, path: Path) -> None:
    filters = dataset.id.get_create_plist()
    kinds = [filters.get_filter(index)[0] for index in range(filters.get_nfilters())]
    if ECF in kinds and not h5py.h5z.filter_avail(ECF):
        raise ValueError(
            f"Expected events without Metavision's own compression (filter {ECF}) in {path}, got "
            "such; convert it with metavision_file_to_dat, or take the RAW file it was made from"
        )


def by_key(arrays: Mapping[str, Held]) -> dict[str, Held]:
    """Arrays by the field that their names mean; none unless all four are there.

    Raises:
        ValueError: two names mean the same field.
    """
    fitting = {field: [n for n in arrays if n.lower() in NAMES[field]] for field in NAMES}
    if not all(fitting.values()):
        return {}
    double = next((names for names in fitting.values() if len(names) > 1), None)
    if double:
        raise ValueError(f"Expected one of {' and '.join(double)}, got both; keep one of them")
    return {field: arrays[names[0]] for field, names in fitting.items()}


def by_order(table: NDArray[Any], path: Path, order: str | None) -> dict[str, NDArray[Any]]:
    """Columns by their order, which is given, or the only one that fits.

    Raises:
        ValueError: the order is none, or several fit, or none does.
    """
    if table.ndim != 2 or table.shape[1] != 4:
        raise ValueError(f"Expected four columns in {path}, got shape {table.shape}")
    if order is not None:
        return dict(zip(order, table.T, strict=True))
    fitting = [each for each in ORDERS if fits(dict(zip(each, table.T, strict=True)))]
    return dict(zip(one_order(fitting, path), table.T, strict=True))


def one_order(fitting: list[str], path: Path) -> str:
    """The only order that fits.

    Raises:
        ValueError: none does, or several do.
    """
    if len(fitting) != 1:
        raise ValueError(
            f"Expected columns that fit one order in {path}, got "
            f"{' and '.join(fitting) or 'none'}; set order, for instance order=txyp"
        )
    return fitting[0]


def fits(columns: Mapping[str, NDArray[Any]]) -> bool:
    """Whether columns can be what an order says: rising times, pixels, two polarities."""
    t, p = columns["t"], columns["p"]
    pixels = _are_pixels(columns["x"]) and _are_pixels(columns["y"])
    return bool(pixels and np.isin(p, (-1, 0, 1)).all() and np.all(t[1:] >= t[:-1]))


def decoded(
    columns: Mapping[str, NDArray[Any]],
    path: Path,
    kind: str,
    time_unit: str | None = None,
    height: int | None = None,
    width: int | None = None,
) -> Decoded:
    """Columns in this project's convention.

    Raises:
        ValueError: the unit of the times is not known and cannot be told, or a number is none that
            a time, a pixel or a polarity can be.
    """
    _check(columns, path)
    t = columns["t"]
    if time_unit is None:
        if len(t) and not has_fractions(t):
            raise unit_unknown(path, t.min(), t.max())
        time_unit = "s"
    x, y = (columns[name].astype(np.int64) for name in "xy")
    return Decoded(
        kind=f"{kind}, times in {time_unit}", t=microseconds(t, time_unit, path), x=x, y=y,
        p=(columns["p"] > 0).astype(np.uint8), height=height, width=width,
    )  # fmt: skip


def unit_unknown(path: Path, least: float, most: float) -> ValueError:
    """The sentence about times whose unit cannot be told."""
    return ValueError(
        f"Expected to know the unit of the whole-numbered times in {path}, got {least:.0f} to "
        f"{most:.0f} of any; set time_unit=us, ns, ms or s"
    )


def _are_pixels(values: NDArray[Any]) -> bool:
    inside = values.min(initial=0) >= 0 and values.max(initial=0) <= LAST_PIXEL
    return bool(inside) and not has_fractions(values)


def has_fractions(values: NDArray[Any]) -> bool:
    """Whether a number is none of the whole ones."""
    return values.dtype.kind == "f" and bool(np.any(values != np.floor(values)))


def _check(columns: Mapping[str, NDArray[Any]], path: Path) -> None:
    """Whether every column is a row of as many numbers, pixels whole and polarities known."""
    shapes = {name: values.shape for name, values in columns.items()}
    kinds = {values.dtype.kind for values in columns.values()}
    if len({*shapes.values()}) > 1 or len(shapes["t"]) != 1 or not kinds <= {*"iufb"}:
        raise ValueError(f"Expected rows of as many numbers in {path}, got {shapes}; convert it")
    for name in "txy":
        values = columns[name]
        if not np.isfinite(values).all() or (name != "t" and not _are_pixels(values)):
            raise ValueError(
                f"Expected finite times and whole pixels of 0 to {LAST_PIXEL} in {path}, got "
                f"others in {name}; set order, or leave those events out"
            )
    if not np.isin(columns["p"], (-1, 0, 1)).all():
        raise ValueError(
            f"Expected polarities of 0 and 1 or -1 and 1 in {path}, got {columns['p'].min()} to "
            f"{columns['p'].max()}; set order, or write 1 for brighter"
        )


def microseconds(t: NDArray[Any], time_unit: str, path: Path) -> NDArray[np.int64]:
    """Times of a unit in whole microseconds, the fractions cut off.

    Raises:
        ValueError: a time is too large.
    """
    factor = UNITS_US[time_unit]
    most = max(abs(float(t.min(initial=0))), abs(float(t.max(initial=0))))
    if most * factor >= LATEST_US:
        raise ValueError(
            f"Expected times below {LATEST_US} us in {path}, got {most:g} {time_unit}; set order "
            "or time_unit"
        )
    if t.dtype.kind in "iub":  # whole numbers stay exact
        whole: NDArray[np.int64] = (
            (t // 1000).astype(np.int64) if time_unit == "ns" else t.astype(np.int64) * int(factor)
        )
        return whole
    exact = t.astype(np.float64) * factor
    # What was written, past float's rounding.
    below: NDArray[np.float64] = np.floor(exact + 2 * np.spacing(np.abs(exact)))
    return below.astype(np.int64)
