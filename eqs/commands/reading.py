"""Options that say how to read an event file, shared by the verbs that read any."""

from __future__ import annotations

import argparse
from pathlib import Path

from eqs.events import Events
from eqs.events.formats import decode, is_dsec
from eqs.events.hints import UNITS_US, Hints


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("--height", type=int, help="rows, where the file does not say")
    parser.add_argument("--width", type=int, help="columns, where the file does not say")
    parser.add_argument("--order", help="order of a table's columns, for instance txyp")
    parser.add_argument("--time-unit", choices=[*UNITS_US], help="unit of a table's times")
    parser.add_argument(
        "--first-pixel", type=int, choices=[0, 1], help="first row and column in a MATLAB file"
    )


def read(path: Path, given: argparse.Namespace) -> tuple[str, int, int, Events]:
    """What a file is, how many of its events were out of order or dropped, and the stream.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is of no known kind, damaged, or fits several readings.
    """
    if is_dsec(path):
        return "HDF5 in the layout of DSEC", 0, 0, Events.load(path, given.height, given.width)
    names = ("height", "width", "order", "time_unit", "first_pixel")
    found = decode(path, Hints(**{name: getattr(given, name) for name in names}))
    return found.kind, found.disorder, found.dropped, found.events(given.height, given.width)
