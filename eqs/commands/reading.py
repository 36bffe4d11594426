"""Options that say how to read an event file, shared by the verbs that read any."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from pathlib import Path

from rich.console import Console
from rich.progress import track

from eqs.events import Events
from eqs.events.hints import STAMPS, UNITS_US, Hints
from eqs.events.ordered import HELD, OrderedFile


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("--height", type=int, help="rows, where the file does not say")
    parser.add_argument("--width", type=int, help="columns, where the file does not say")
    parser.add_argument("--order", help="order of a table's columns, for instance txyp")
    parser.add_argument("--time-unit", choices=[*UNITS_US], help="unit of a table's times")
    parser.add_argument(
        "--first-pixel", type=int, choices=[0, 1], help="first row and column in a MATLAB file"
    )
    parser.add_argument(
        "--topic",
        action="append",
        default=[],
        metavar="TOPIC",
        help="topic of a bag, where it holds several of events or of frames; once for each",
    )
    parser.add_argument(
        "--stamp",
        choices=STAMPS,
        default="event",
        help="time that counts in a bag's arrays: each event's own, or its message's",
    )
    parser.add_argument(
        "--invert-polarity",
        action="store_true",
        help="the file calls darker what is called brighter here, as Gazebo's plugin does",
    )
    parser.add_argument(
        "--whole",
        action="store_true",
        help=f"hold all of the file, to sort events that come more than {HELD} places late",
    )


def hints(given: argparse.Namespace) -> Hints:
    """What the command line says about the file.

    Raises:
        ValueError: it says what no file can be.
    """
    names = ("height", "width", "order", "time_unit", "first_pixel", "stamp", "invert_polarity")
    told = {name: getattr(given, name) for name in names}
    return Hints(**told, topics=tuple(given.topic))


def opened(path: Path, given: argparse.Namespace) -> OrderedFile:
    """The file, to be read piece by piece.

    Raises:
        ValueError: the command line says what no file can be.
    """
    return OrderedFile(path, hints(given), None if given.whole else HELD)


def with_progress(pieces: Iterable[Events], what: str) -> Iterator[Events]:
    """The pieces, with a sign of life on a terminal while they pass."""
    console = Console(stderr=True)
    return iter(
        track(pieces, what, console=console, transient=True, disable=not console.is_terminal)
    )
