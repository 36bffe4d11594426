"""Say what an event file holds: format, sensor, events, span, rate, polarity, gaps, disorder."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eqs.commands.reading import add_reading, opened, with_progress
from eqs.events import Events
from eqs.events.ordered import OrderedFile

SHADES = " .:-=+*#%@"
COLUMNS, ROWS = 64, 20


class Tally:
    """What is said of a stream, counted piece by piece.

    Args:
        columns: columns of the sketch, at most.
        rows: rows of the sketch, at most.

    Example:
        >>> tally = Tally(columns=4, rows=2)
        >>> tally.add(Events.from_arrays([1, 9], [0, 3], [0, 1], [1, 0], height=2, width=4))
        >>> tally.count, tally.first_us, tally.last_us, tally.gap_us, tally.brighter
        (2, 1, 9, 8, 1)
        >>> print(sketch(tally.picture))
        @
           @
    """

    def __init__(self, columns: int = COLUMNS, rows: int = ROWS) -> None:
        """Begin with nothing."""
        self.columns, self.rows = columns, rows
        self.height = self.width = self.count = self.brighter = self.gap_us = 0
        self.first_us = self.last_us = 0
        self.picture: NDArray[np.int64] = np.zeros((0, 0), np.int64)

    def add(self, events: Events) -> None:
        """Count the next events."""
        if not self.picture.size:
            self.height, self.width = events.height, events.width
            shape = min(self.rows, self.height), min(self.columns, self.width)
            self.picture = np.zeros(shape, np.int64)
        if not len(events):
            return
        if not self.count:
            self.first_us = self.last_us = int(events.t[0])
        inside = int(np.diff(events.t).max(initial=0))
        self.gap_us = max(self.gap_us, inside, int(events.t[0]) - self.last_us)
        self.last_us = int(events.t[-1])
        self.count += len(events)
        self.brighter += int(events.p.sum(dtype=np.int64))
        rows, columns = self.picture.shape
        down = events.y.astype(np.int64) * rows // self.height
        place = down * columns + events.x.astype(np.int64) * columns // self.width
        self.picture += np.bincount(place, minlength=rows * columns).reshape(rows, columns)

    @classmethod
    def of(cls, pieces: Iterable[Events]) -> Tally:
        """The tally of a stream in pieces."""
        tally = cls()
        for piece in pieces:
            tally.add(piece)
        return tally


def sketch(counts: NDArray[np.int64]) -> str:
    """Counts as a picture of letters: the darker, the more on a logarithmic scale."""
    share = np.log1p(counts) / max(np.log1p(counts.max(initial=0)), 1e-9)
    letters = np.array(list(SHADES))[np.ceil(share * (len(SHADES) - 1)).astype(int)]
    return "\n".join("".join(row).rstrip() for row in letters)


def described(file: OrderedFile, tally: Tally) -> list[str]:
    """What a file is that has been read, a line each."""
    lines = [f"format      {file.kind}", f"sensor      {tally.width} x {tally.height}"]
    lines.append(f"events      {tally.count:,}")
    if tally.count:
        seconds = (tally.last_us - tally.first_us) / 1e6
        lines += [
            f"first       {tally.first_us} us",
            f"last        {tally.last_us} us",
            f"lasts       {seconds:.6f} s",
            f"rate        {tally.count / max(seconds, 1e-6) / 1e6:.3f} million a second",
            f"brighter    {100 * tally.brighter / tally.count:.1f} %",
            f"longest gap {tally.gap_us} us",
        ]
    if file.span_us:
        lines.append(f"watched     {file.span_us[0]} to {file.span_us[1]} us")
    lines.append(f"disorder    {file.disorder} events came after a later one")
    if file.dropped:
        lines.append(f"dropped     {file.dropped} events before the first time")
    return lines


def main(arguments: Sequence[str], shown: str) -> None:
    """Read the command line and print."""
    parser = argparse.ArgumentParser(prog=shown, description=__doc__)
    parser.add_argument("file", type=Path, help="an event file of any kind that is read here")
    add_reading(parser)
    given = parser.parse_args(arguments)
    try:
        file = opened(given.file, given)
        tally = Tally.of(with_progress(file, f"reading {given.file}"))
    except (OSError, ValueError) as error:
        sys.exit(str(error))
    lines = [*described(file, tally), "", sketch(tally.picture), ""]
    sys.stdout.write("\n".join(lines))
