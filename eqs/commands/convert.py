"""Convert an event file of any kind to HDF5 in the layout of DSEC."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from eqs.commands.reading import add_reading, opened
from eqs.events import EventWriter


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
        pieces = opened(given.file, given)
        count = 0
        with EventWriter(given.out, pieces.height, pieces.width) as writer:
            for events in pieces:
                writer.append(events)
                count += len(events)
            writer.span_us = pieces.span_us
    except (OSError, ValueError) as error:
        sys.exit(str(error))
    sorted_in = f", {pieces.disorder} of them put in order" if pieces.disorder else ""
    sys.stdout.write(f"{given.out}: {count:,} events of {pieces.kind}{sorted_in}\n")
