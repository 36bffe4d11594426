"""Say what an event file holds: format, sensor, events, span, rate, polarity, gaps, disorder."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from eqs.commands.reading import add_reading, read
from eqs.events import Events

SHADES = " .:-=+*#%@"
COLUMNS, ROWS = 64, 20


def sketch(events: Events, columns: int = COLUMNS, rows: int = ROWS) -> str:
    """The events of a stream as a picture of letters: the darker, the more on a logarithmic scale.

    Example:
        >>> events = Events.from_arrays([1, 2], [0, 3], [0, 1], [1, 0], height=2, width=4)
        >>> print(sketch(events, columns=4, rows=2))
        @
           @
    """
    columns, rows = min(columns, events.width), min(rows, events.height)
    counts = np.zeros((rows, columns))
    down = events.y.astype(int) * rows // events.height
    across = events.x.astype(int) * columns // events.width
    np.add.at(counts, (down, across), 1)
    share = np.log1p(counts) / max(np.log1p(counts.max(initial=0)), 1e-9)
    letters = np.array(list(SHADES))[np.ceil(share * (len(SHADES) - 1)).astype(int)]
    return "\n".join("".join(row).rstrip() for row in letters)


def described(kind: str, disorder: int, dropped: int, events: Events) -> list[str]:
    """What a stream is, a line each."""
    lines = [f"format      {kind}", f"sensor      {events.width} x {events.height}"]
    count = len(events)
    lines.append(f"events      {count:,}")
    if count:
        first, last = int(events.t[0]), int(events.t[-1])
        seconds = (last - first) / 1e6
        gap = int(np.diff(events.t).max(initial=0))
        lines += [
            f"first       {first} us",
            f"last        {last} us",
            f"lasts       {seconds:.6f} s",
            f"rate        {count / max(seconds, 1e-6) / 1e6:.3f} million a second",
            f"brighter    {100 * float(np.mean(events.p)):.1f} %",
            f"longest gap {gap} us",
        ]
    if events.span_us:
        lines.append(f"watched     {events.span_us[0]} to {events.span_us[1]} us")
    lines.append(f"disorder    {disorder} events came after a later one")
    if dropped:
        lines.append(f"dropped     {dropped} events before the first time")
    return lines


def main(arguments: Sequence[str], shown: str) -> None:
    """Read the command line and print."""
    parser = argparse.ArgumentParser(prog=shown, description=__doc__)
    parser.add_argument("file", type=Path, help="an event file of any kind that is read here")
    add_reading(parser)
    given = parser.parse_args(arguments)
    try:
        kind, disorder, dropped, events = read(given.file, given)
    except (OSError, ValueError) as error:
        sys.exit(str(error))
    lines = [*described(kind, disorder, dropped, events), "", sketch(events), ""]
    sys.stdout.write("\n".join(lines))
