"""Show an event file as a GIF, an MP4 or a strip of stills."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eqs.drawing import event_pictures, framed, picture_times, write_film
from eqs.drawing.film import Picture
from eqs.events.formats import open_events
from eqs.files import refuse_foreign
from eqs.frames import FrameFolder, linear_to_srgb
from eqs.pipelines.simulate import open_clip


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
    parser.add_argument("--frames", type=Path, help="folder of images, shown above their events")
    parser.add_argument("--white", type=float, help="white of floating frames of linear light")
    parser.add_argument("--zoom", type=int, default=1, help="screen pixels per pixel")
    given = parser.parse_args(arguments)
    out = given.out or given.events.with_suffix(".gif")
    try:
        refuse_foreign(out)  # before the work
        write_film(out, film_pictures(given), frames_per_second=given.rate, zoom=given.zoom)
    except (OSError, ValueError) as error:
        sys.exit(str(error))
    sys.stdout.write(f"{out}\n")


def film_pictures(given: argparse.Namespace) -> list[Picture]:
    """The pictures asked for, with the frames of their instants where a folder of them is given."""
    with open_events(given.events, given.height, given.width) as reader:
        start_us = reader.start_us
        stop_us = min(reader.stop_us, start_us + int(1e6 * given.seconds))
        count = max(1, round((stop_us - start_us) * 1e-6 * given.slower * given.rate))
        window_us = int(1000 * given.window_ms)
        pictures = list(
            event_pictures(
                reader, start_us=start_us, stop_us=stop_us, window_us=window_us, pictures=count
            )
        )
    if given.frames is None:
        return pictures
    clip = open_clip(given.frames, None, given.white)
    if not isinstance(clip, FrameFolder):
        raise ValueError(f"Expected a folder of images, got {given.frames}; name its folder")
    times = picture_times(start_us, stop_us, window_us, count)
    numbers = np.searchsorted(clip.timestamps_us, times, side="right") - 1
    shown = (display_frame(clip, max(int(number), 0)) for number in numbers)
    return [framed(picture, frame) for picture, frame in zip(pictures, shown, strict=True)]


def display_frame(clip: FrameFolder, number: int) -> NDArray[np.uint8]:
    """A frame for a screen; floating ones are light, which a screen wants on its curve."""
    (frame,) = clip.read(number, number + 1)
    if clip.white is not None and frame.dtype.kind == "f":
        frame = 255.0 * linear_to_srgb(frame.astype(np.float64) / 255.0)
    shown: NDArray[np.uint8] = np.rint(np.clip(frame, 0, 255)).astype(np.uint8)
    return shown
