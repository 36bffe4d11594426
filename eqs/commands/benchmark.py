"""Time simulators, score, detector, event files, interpolation, or reading for a training."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from eqs.benchmarks import bags, event_files, interpolation, reading, rvt, scoring, simulators
from eqs.commands.fetch_interpolator import INTO


def main(arguments: Sequence[str], shown: str) -> None:
    """Read the command line and print one table."""
    parser = argparse.ArgumentParser(prog=shown, description=__doc__)
    parser.add_argument(
        "what", choices=["simulators", "rvt", "eqs", "data", "files", "bags", "interpolation"]
    )
    clip = parser.add_argument_group("simulators, eqs, data and interpolation")
    clip.add_argument("--frames", type=int, help="60 for simulators, 300 windows for eqs")
    clip.add_argument("--size", help="width and height; 128x96 for interpolation, else 640x480")
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
    clip.add_argument("--worlds", type=int, default=3, help="interpolation: streets to render")
    clip.add_argument(
        "--networks", type=Path, nargs="*", default=[INTO], help="interpolation: files of networks"
    )
    given = parser.parse_args(arguments)
    given.size = given.size or ("128x96" if given.what == "interpolation" else "640x480")
    width, _, height = given.size.partition("x")
    if not (width.isdigit() and height.isdigit()):
        sys.exit(f"Expected a size like 640x480, got {given.size}; set --size")
    try:
        print_table(given, (int(width), int(height)))
    except (OSError, ValueError) as error:
        sys.exit(str(error))


def print_table(given: argparse.Namespace, size: tuple[int, int]) -> None:
    """Print what was asked for."""
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
    elif given.what == "interpolation":
        interpolation.print_table(given.worlds, *size, given.networks)
    else:
        simulators.print_table(given.frames or 60, *size, given.only, given.clip)
