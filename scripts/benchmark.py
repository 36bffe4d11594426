"""Time the simulators, or the detector's fast path against the same function computed plainly."""

import argparse
import sys

from eqs.benchmarks import rvt, simulators


def main() -> None:
    """Print one table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["simulators", "rvt"])
    clip = parser.add_argument_group("simulators")
    clip.add_argument("--frames", type=int, default=60)
    clip.add_argument("--size", default="640x480", help="width and height")
    clip.add_argument("--only", nargs="*", choices=simulators.NAMES, default=simulators.NAMES)
    given = parser.parse_args()
    if given.what == "rvt":
        rvt.print_table()
        return
    width, _, height = given.size.partition("x")
    if not (width.isdigit() and height.isdigit()):
        sys.exit(f"Expected a size like 640x480, got {given.size}; set --size")
    simulators.print_table(given.frames, int(width), int(height), given.only)


if __name__ == "__main__":
    main()
