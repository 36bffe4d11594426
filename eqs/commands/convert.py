"""Convert an event file of any kind to HDF5 in the layout of DSEC."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from eqs.commands.reading import add_reading, opened, with_progress
from eqs.events import EventWriter
from eqs.events.ordered import OrderedFile


def main(arguments: Sequence[str], shown: str) -> None:
    """Read the command line and write the file."""
    parser = argparse.ArgumentParser(prog=shown, description=__doc__)
    parser.add_argument("file", type=Path, help="an event file of any kind that is read here")
    parser.add_argument("out", type=Path, help="where the HDF5 file goes; nothing may be there")
    add_reading(parser)
    given = parser.parse_args(arguments)
    try:
        if given.out.exists():
            raise ValueError(f"Expected no file at {given.out}, got one; name another place")
        file = opened(given.file, given)
        count = written(file, given.out)
    except (OSError, ValueError) as error:
        sys.exit(str(error))
    sorted_in = f", {file.disorder} of them put in order" if file.disorder else ""
    sys.stdout.write(f"{given.out}: {count:,} events of {file.kind}{sorted_in}\n")


def written(file: OrderedFile, out: Path) -> int:
    """Write a file's events, and say how many there are.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it cannot be read, or not be written.
    """
    pieces = with_progress(iter(file), f"writing {out}")
    first = next(pieces)
    count = len(first)
    with EventWriter(out, height=first.height, width=first.width) as writer:
        writer.append(first)
        for piece in pieces:
            writer.append(piece)
            count += len(piece)
        writer.span_us = file.span_us
    return count
