"""Convert an event file of any kind to HDF5 in the layout of DSEC."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from eqs.commands.reading import add_reading, read


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
        kind, disorder, _, events = read(given.file, given)
        events.save(given.out)
    except (OSError, ValueError) as error:
        sys.exit(str(error))
    sorted_in = f", {disorder} of them put in order" if disorder else ""
    sys.stdout.write(f"{given.out}: {len(events):,} events of {kind}{sorted_in}\n")
