"""Event files of any kind, brought into the layout of DSEC once."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

from eqs.content import content_hash
from eqs.events import Events, EventWriter
from eqs.events.formats import decode, is_dsec
from eqs.events.pieces import EventPieces, ReadAs
from eqs.files import one_at_a_time, short_hash


@dataclass(frozen=True, kw_only=True)
class Tables:
    """What tables of numbers do not say of themselves.

    Args:
        order: order of the columns, for instance `txyp`.
        time_unit: unit of whole-numbered times: s, ms, us or ns.
        first_pixel: number of the first column and row in a MATLAB file, 0 or 1.
    """

    order: str | None = None
    time_unit: str | None = None
    first_pixel: int | None = None


def converted(
    path: Path, folder: Path | str, height: int, width: int, tables: Tables | None = None
) -> Path:
    """The file itself where it is in the layout of DSEC, else a copy that is, made if need be.

    Args:
        path: an event file of any kind.
        folder: where copies are kept, by what the files hold.
        height: rows of the sensor.
        width: columns of the sensor.
        tables: how to read tables of numbers.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file cannot be read, or is of another sensor.
    """
    if is_dsec(path):
        return path
    read_as = short_hash([height, width, asdict(tables or Tables())])
    kept = Path(folder) / f"{path.stem}-{content_hash(path)}-{read_as}.h5"
    if not kept.exists():
        with one_at_a_time(kept, f"converting {path}"):
            if not kept.exists():  # another process was at it
                _convert(path, kept, height, width, tables or Tables())
    return kept


def _convert(path: Path, kept: Path, height: int, width: int, tables: Tables) -> None:
    pieces = EventPieces(path, ReadAs(height=height, width=width, **asdict(tables)))
    with EventWriter(kept, height, width) as writer:
        for events in pieces:
            writer.append(events)
        writer.span_us = pieces.span_us


def read(path: Path, height: int, width: int, tables: Tables | None = None) -> Events:
    """The events of a file of any kind.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file cannot be read, or is of another sensor.
    """
    if is_dsec(path):
        return Events.load(path, height, width)
    tables = tables or Tables()
    found = decode(path, tables.order, tables.time_unit, tables.first_pixel)
    return found.events(height, width)
