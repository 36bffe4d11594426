"""Show an event file as a GIF, an MP4 or a strip of stills."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from eqs.drawing import event_pictures, write_film
from eqs.events.formats import open_events
from eqs.files import refuse_foreign


def main(arguments: Sequence[str], shown: str) -> None:
    """Read the command line and write the film."""
    parser = argparse.ArgumentParser(prog=shown, description=__doc__)
    parser.add_argument("events", type=Path, help="HDF5 file in DSEC layout")
    parser.add_argument("out", type=Path, nargs="?", help=".gif, .mp4 or .png; default: a GIF")
    parser.add_argument("--height", type=int, help="rows, where the file does not say")
    parser.add_argument("--width", type=int, help="columns, where the file does not say")
    parser.add_argument("--window-ms", type=float, default=33.0, help="what a picture shows")
    parser.add_argument("--seconds", type=float, default=3.0, help="from the file's start")
    parser.add_argument("--slower", type=float, default=1.0, help="factor of slow motion")
    parser.add_argument("--rate", type=float, default=30.0, help="pictures per second of the film")
    parser.add_argument("--zoom", type=int, default=1, help="screen pixels per pixel")
    given = parser.parse_args(arguments)
    out = given.out or given.events.with_suffix(".gif")
    try:
        refuse_foreign(out)  # before the work
        with open_events(given.events, given.height, given.width) as reader:
            start_us = reader.start_us
            stop_us = min(reader.stop_us, start_us + int(1e6 * given.seconds))
            pictures = event_pictures(
                reader,
                start_us=start_us,
                stop_us=stop_us,
                window_us=int(1000 * given.window_ms),
                pictures=max(1, round((stop_us - start_us) * 1e-6 * given.slower * given.rate)),
            )
            write_film(out, list(pictures), frames_per_second=given.rate, zoom=given.zoom)
    except (OSError, ValueError) as error:
        sys.exit(str(error))
    sys.stdout.write(f"{out}\n")
