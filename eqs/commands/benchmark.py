"""Time simulators, score, detector, event files, or reading for a training, on this machine."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from eqs.benchmarks import bags, event_files, reading, rvt, scoring, simulators


def main(arguments: Sequence[str], shown: str) -> None:
    """Read the command line and print one table."""
    parser = argparse.ArgumentParser(prog=shown, description=__doc__)
    parser.add_argument("what", choices=["simulators", "rvt", "eqs", "data", "files", "bags"])
    clip = parser.add_argument_group("simulators, eqs and data")
    clip.add_argument("--frames", type=int, help="60 for simulators, 300 windows for eqs")
    clip.add_argument("--size", default="640x480", help="width and height")
    clip.add_argument("--clip", type=Path, help="simulators: a folder of images, taken as 20 Hz")
    clip.add_argument(
        "--events", type=float, help="in a recording: 60e6 for data and files, 6e6 for bags"
    )
    clip.add_argument(
        "--only",
        nargs="*",
        choices=simulators.NAMES,
        default=simulators.NAMES,
        help="some simulators",
    )
    given = parser.parse_args(arguments)
    width, _, height = given.size.partition("x")
    if not (width.isdigit() and height.isdigit()):
        sys.exit(f"Expected a size like 640x480, got {given.size}; set --size")
    size = int(width), int(height)
    try:
        if given.what == "rvt":
            rvt.print_table()
        elif given.what == "eqs":
            scoring.print_table(given.frames or 300, *size)
        elif given.what == "data":
            reading.print_table(int(given.events or 60e6), *size)
        elif given.what == "files":
            event_files.print_table(int(given.events or 60e6))
        elif given.what == "bags":
            bags.print_table(int(given.events or 6e6))
        else:
            simulators.print_table(given.frames or 60, *size, given.only, given.clip)
    except (OSError, ValueError) as error:
        sys.exit(str(error))
