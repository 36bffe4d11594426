"""Time the simulators, the score, long event files, or the detector against a plain one."""

import argparse
import sys
from pathlib import Path

from benchmarks import event_files, rvt, scoring, simulators


def main() -> None:
    """Print one table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["simulators", "rvt", "eqs", "files"])
    clip = parser.add_argument_group("simulators and eqs")
    clip.add_argument("--frames", type=int, help="60 for simulators, 300 windows for eqs")
    clip.add_argument("--size", default="640x480", help="width and height")
    clip.add_argument("--clip", type=Path, help="simulators: a folder of images, taken as 20 Hz")
    clip.add_argument(
        "--only",
        nargs="*",
        choices=simulators.NAMES,
        default=simulators.NAMES,
        help="some simulators",
    )
    parser.add_argument("--events", type=int, default=100, help="files: millions of events")
    given = parser.parse_args()
    if given.what == "files":
        event_files.print_table(given.events * 1_000_000)
        return
    if given.what == "rvt":
        rvt.print_table()
        return
    width, _, height = given.size.partition("x")
    if not (width.isdigit() and height.isdigit()):
        sys.exit(f"Expected a size like 640x480, got {given.size}; set --size")
    if given.what == "eqs":
        scoring.print_table(given.frames or 300, int(width), int(height))
    else:
        size = int(width), int(height)
        try:
            simulators.print_table(given.frames or 60, *size, given.only, given.clip)
        except (OSError, ValueError) as error:
            sys.exit(f"{error} (--clip)")


if __name__ == "__main__":
    main()
