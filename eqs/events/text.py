"""Events in text files: four numbers a line, in seconds or another unit, perhaps in a zip."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from eqs.events.decoded import Decoded, blocks
from eqs.events.hints import Hints
from eqs.events.tables import (
    DAMAGED_ZIP,
    ORDERS,
    ZIP,
    by_key,
    decoded,
    fits,
    has_fractions,
    one_order,
    unit_unknown,
)

LONGEST_LINE = 1 << 16
NO_WHOLE_NUMBER = re.compile(r"[.a-zA-Z]")


def read_text(path: Path, size: int, hints: Hints) -> Iterator[Decoded]:
    """Events of a text file or a zip of one, with a header or without, piece by piece.

    A first line of two numbers is the sensor's width and height. The file is read twice, since only
    all of it says which order and unit fit.

    Raises:
        ValueError: the lines are no events, or fit several orders or units.
    """
    head = _head(path)
    places = head.places() or _in_order(hints.order or "")
    if not head.columns and not head.places():
        raise ValueError(f"Expected four numbers a line in {path}, got none; convert it")
    survey = Survey(head.columns or len(head.names))
    for lines in _lines(path, size, head.lines):
        survey.add(lines, path, numbers=not (places and hints.time_unit))
        if places and survey.fractions[places["t"]] and not survey.whole:
            break  # all is known
    places = places or _in_order(one_order(survey.orders, path))
    unit = hints.time_unit or survey.unit(places["t"], path)
    kind = np.dtype(np.int64 if survey.whole else np.float64)
    for lines in _lines(path, size, head.lines):
        table = _table(lines, head.columns or len(head.names), kind, path)
        named = {name: table[:, place] for name, place in places.items()}
        yield decoded(named, path, "a text file", unit, head.height, head.width)


def _in_order(order: str) -> dict[str, int]:
    return {name: place for place, name in enumerate(order)}


@dataclass(frozen=True, kw_only=True)
class Head:
    """What stands above the first four numbers.

    Args:
        lines: how many lines that are not empty.
        names: what the last of them with letters calls the columns.
        height: rows of the sensor, where a line of two numbers says so.
        width: columns of the sensor.
        columns: how many numbers follow in a line; 0 where none does.
    """

    lines: int
    names: tuple[str, ...]
    height: int | None
    width: int | None
    columns: int

    def places(self) -> dict[str, int]:
        """The column of each field by its name; none where the names are not known."""
        if self.columns not in (0, len(self.names)):
            return {}
        plain = [name.partition("_")[0].partition("[")[0] for name in self.names]  # t_us, t[us]
        return by_key({name: place for place, name in enumerate(plain)})


def _head(path: Path) -> Head:
    count, columns = 0, 0
    names: list[str] = []
    height = width = None
    for line in (line for lines in _lines(path, LONGEST_LINE) for line in lines):
        if _are_numbers(line, 4):
            columns = len(line.split())
            break
        count += 1
        if len(line.split()) == 2 and _are_numbers(line, 2):
            width, height = (int(float(part)) for part in line.split())
        elif any(letter.isalpha() for letter in line):
            names = line.lstrip("#% ").split()
    return Head(lines=count, names=(*names,), height=height, width=width, columns=columns)


def _are_numbers(line: str, count: int) -> bool:
    parts = line.split()[:count]
    try:
        return len(parts) == count and all(np.isfinite(float(part)) for part in parts)
    except ValueError:
        return False


class Survey:
    """What a whole file tells of its columns.

    Args:
        columns: how many there are.
    """

    def __init__(self, columns: int) -> None:
        """Begin with what fits and nothing seen."""
        self.orders, self.whole = [*ORDERS], True
        self.fractions = np.zeros(columns, np.bool_)
        self._least = np.full(columns, np.inf)
        self._most = -self._least
        self._last = np.zeros((0, columns))

    def add(self, lines: list[str], path: Path, *, numbers: bool) -> None:
        """Take in the next lines; the numbers themselves only where they are wanted."""
        self.whole = self.whole and not any(NO_WHOLE_NUMBER.search(line) for line in lines)
        if not numbers:
            self.fractions |= not self.whole
            return
        table = _table(lines, len(self.fractions), np.dtype(np.float64), path)
        self.fractions |= [has_fractions(column) for column in table.T]
        self._least = np.minimum(self._least, table.min(axis=0, initial=np.inf))
        self._most = np.maximum(self._most, table.max(axis=0, initial=-np.inf))
        joined = np.vstack([self._last, table])
        self.orders = [
            order for order in self.orders
            if len(order) == table.shape[1] and fits(dict(zip(order, joined.T, strict=True)))
        ]  # fmt: skip
        self._last = joined[-1:]

    def unit(self, place: int, path: Path) -> str:
        """Seconds, where times have fractions.

        Raises:
            ValueError: they have none.
        """
        if np.isfinite(self._least[place]) and not self.fractions[place]:
            raise unit_unknown(path, self._least[place], self._most[place])
        return "s"


def _table(lines: list[str], columns: int, kind: np.dtype[Any], path: Path) -> NDArray[Any]:
    """The numbers of some lines."""
    lines = [line for line in lines if not line.lstrip().startswith("#")]
    if not lines:
        return np.zeros((0, columns), kind)
    try:
        table = np.loadtxt(io.StringIO("\n".join(lines)), dtype=kind, ndmin=2)
    except (ValueError, OverflowError) as error:
        raise ValueError(f"Expected four numbers a line in {path}, got: {error}") from error
    if table.shape[1] != columns:
        raise ValueError(
            f"Expected {columns} numbers a line in {path}, as in the first, got {table.shape[1]}; "
            "convert it"
        )
    return table


def _lines(path: Path, size: int, skipped: int = 0) -> Iterator[list[str]]:
    """The lines that are not empty, blanks between their parts, without so many at the start."""
    rest = b""
    with _opened(path) as file:
        for block in blocks(file, size, 1):
            whole, mark, rest = (rest + block.replace(b"\r", b"\n")).rpartition(b"\n")
            if len(rest) > LONGEST_LINE:
                raise ValueError(f"Expected lines of four numbers in {path}, got a longer one")
            lines = _split(whole + mark)
            yield lines[skipped:]
            skipped = max(0, skipped - len(lines))
        yield _split(rest)[skipped:]


def _split(content: bytes) -> list[str]:
    text = content.decode("utf-8", "replace").replace("\ufeff", "")
    text = text.replace(",", " ").replace(";", " ").replace("\0", "?")
    return [line for line in text.split("\n") if line.strip()]


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    """A text file, or the one in a zip."""
    with path.open("rb") as file:
        if file.read(len(ZIP)) != ZIP:
            file.seek(0)
            yield file
            return
    try:
        with zipfile.ZipFile(path) as archive, archive.open(_member(archive, path)) as member:
            yield member  # type: ignore[misc]
    except DAMAGED_ZIP as error:
        raise ValueError(f"Expected a whole zip at {path}, got: {error}") from error


def _member(archive: zipfile.ZipFile, path: Path) -> str:
    """The file of events in a zip: `events.txt`, or the only text."""
    names = [name for name in archive.namelist() if name.lower().endswith((".txt", ".csv", ".tsv"))]
    chosen = [name for name in names if Path(name).name == "events.txt"] or names
    if len(chosen) != 1:
        raise ValueError(
            f"Expected events.txt or one text in {path}, got {', '.join(names) or 'none'}; zip the "
            "events alone"
        )
    return chosen[0]
