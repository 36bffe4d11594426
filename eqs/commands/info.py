"""Say what an event file holds: format, sensor, events, span, rate, polarity, gaps, disorder."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eqs.commands.reading import add_reading, opened
from eqs.events import Events
from eqs.events.pieces import EventPieces

SHADES = " .:-=+*#%@"
COLUMNS, ROWS = 64, 20


class Summary:
    """What a stream is, gathered piece by piece.

    Args:
        height: rows of the sensor.
        width: columns of the sensor.
    """

    def __init__(self, height: int, width: int) -> None:
        """Nothing was seen yet."""
        self.height, self.width = height, width
        self.count = self.brighter = self.longest_gap_us = 0
        self.first_us = self.last_us = 0
        self.counts = np.zeros((min(ROWS, height), min(COLUMNS, width)))

    def add(self, events: Events) -> None:
        """Take in events that follow those seen; there is at least one."""
        first, last = int(events.t[0]), int(events.t[-1])
        gap = int(np.diff(events.t).max(initial=0))
        if self.count:
            gap = max(gap, first - self.last_us)
        else:
            self.first_us = first
        self.last_us, self.longest_gap_us = last, max(gap, self.longest_gap_us)
        self.count += len(events)
        self.brighter += int(events.p.sum(dtype=np.int64))
        rows, columns = self.counts.shape
        down = events.y.astype(np.int64) * rows // self.height
        across = events.x.astype(np.int64) * columns // self.width
        places = np.bincount(down * columns + across, minlength=rows * columns)
        self.counts += places.reshape(rows, columns)

    def lines(self) -> list[str]:
        """Sensor, numbers and times, a line each."""
        found = [f"sensor      {self.width} x {self.height}", f"events      {self.count:,}"]
        if not self.count:
            return found
        seconds = (self.last_us - self.first_us) / 1e6
        return [
            *found,
            f"first       {self.first_us} us",
            f"last        {self.last_us} us",
            f"lasts       {seconds:.6f} s",
            f"rate        {self.count / max(seconds, 1e-6) / 1e6:.3f} million a second",
            f"brighter    {100 * self.brighter / self.count:.1f} %",
            f"longest gap {self.longest_gap_us} us",
        ]


def sketch(counts: NDArray[np.float64]) -> str:
    """Counts as a picture of letters: the darker, the more on a logarithmic scale.

    Example:
        >>> print(sketch(np.array([[9.0, 0.0], [0.0, 1.0]])))
        @
         -
    """
    share = np.log1p(counts) / max(np.log1p(counts.max(initial=0)), 1e-9)
    letters = np.array(list(SHADES))[np.ceil(share * (len(SHADES) - 1)).astype(int)]
    return "\n".join("".join(row).rstrip() for row in letters)


def described(pieces: EventPieces) -> list[str]:
    """What a file holds, a line each, and a sketch of it."""
    summary = Summary(pieces.height, pieces.width)
    for events in pieces:
        summary.add(events)
    lines = [f"format      {pieces.kind}", *summary.lines()]
    if pieces.span_us:
        lines.append(f"watched     {pieces.span_us[0]} to {pieces.span_us[1]} us")
    lines.append(f"disorder    {pieces.disorder} events came after a later one")
    if pieces.dropped:
        lines.append(f"dropped     {pieces.dropped} events before the first time")
    return [*lines, "", sketch(summary.counts), ""]


def main(arguments: Sequence[str], shown: str) -> None:
    """Read the command line and print."""
    parser = argparse.ArgumentParser(prog=shown, description=__doc__)
    parser.add_argument("file", type=Path, help="an event file of any kind that is read here")
    add_reading(parser)
    given = parser.parse_args(arguments)
    try:
        lines = described(opened(given.file, given))
    except (OSError, ValueError) as error:
        sys.exit(str(error))
    sys.stdout.write("\n".join(lines))
