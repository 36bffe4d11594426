"""Event files of any kind, brought into the layout of DSEC once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from eqs.content import content_hash
from eqs.events import Events, EventWriter
from eqs.events.formats import decode, is_dsec
from eqs.events.hints import NOTHING_SAID, Hints
from eqs.events.ordered import OrderedFile
from eqs.files import one_at_a_time, short_hash


def converted(
    path: Path, folder: Path | str, height: int, width: int, hints: Hints = NOTHING_SAID
) -> Path:
    """The file itself where it is in the layout of DSEC, else a copy that is, made if need be.

    Args:
        path: an event file of any kind.
        folder: where copies are kept, by what the files hold.
        height: rows of the sensor.
        width: columns of the sensor.
        hints: what the file does not say of itself.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file cannot be read, or is of another sensor.
    """
    if is_dsec(path):
        return path
    read_as = short_hash([height, width, hints.record()])
    kept = Path(folder) / f"{path.stem}-{content_hash(path)}-{read_as}.h5"
    if not kept.exists():
        with one_at_a_time(kept, f"converting {path}"):
            if not kept.exists():  # another process was at it
                _convert(path, kept, replace(hints, height=height, width=width))
    return kept


def _convert(path: Path, kept: Path, hints: Hints) -> None:
    file = OrderedFile(path, hints)
    with EventWriter(kept, hints.height or 0, hints.width or 0) as writer:
        for events in file:
            writer.append(events)


def read(path: Path, height: int, width: int, hints: Hints = NOTHING_SAID) -> Events:
    """The events of a file of any kind.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file cannot be read, or is of another sensor.
    """
    if is_dsec(path):
        return Events.load(path, height, width)
    return decode(path, replace(hints, height=height, width=width)).events(height, width)
