"""Options that say how to read an event file, shared by the verbs that read any."""

from __future__ import annotations

import argparse
from pathlib import Path

from eqs.events.pieces import EventPieces, ReadAs
from eqs.events.tables import UNITS_US


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("--height", type=int, help="rows, where the file does not say")
    parser.add_argument("--width", type=int, help="columns, where the file does not say")
    parser.add_argument("--order", help="order of a table's columns, for instance txyp")
    parser.add_argument("--time-unit", choices=[*UNITS_US], help="unit of a table's times")
    parser.add_argument(
        "--first-pixel", type=int, choices=(0, 1), help="first column and row of a MATLAB file"
    )


def opened(path: Path, given: argparse.Namespace) -> EventPieces:
    """The file, to be read piece by piece.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is of no known kind, damaged, or fits several readings.
    """
    names = ("height", "width", "order", "time_unit", "first_pixel")
    return EventPieces(path, ReadAs(**{name: getattr(given, name) for name in names}))
