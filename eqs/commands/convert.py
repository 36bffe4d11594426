"""Convert an event file of any kind, with its frames or without, to the layout of DSEC.

Of a bag whose topics of frames alone are named, only the frames, as a folder of PNG with times.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from eqs.commands.reading import add_reading, opened, with_progress
from eqs.data.bag_frames import IMAGES
from eqs.data.conversion import Written, write_clip, write_events, write_recording
from eqs.data.foreign_frames import EVENTS_TEXT, foreign_frames
from eqs.events.bag import is_bag, kinds_of
from eqs.events.ordered import OrderedFile

SUFFIXES = (".h5", ".hdf5")


def main(arguments: Sequence[str], shown: str) -> None:
    """Read the command line and write the file or the recording."""
    parser = argparse.ArgumentParser(prog=shown, description=__doc__)
    parser.add_argument(
        "file",
        type=Path,
        help="an event file of any kind that is read here, or a folder: a ROS 2 bag, a file for "
        f"each tick of CARLA, or {EVENTS_TEXT} with images",
    )
    parser.add_argument(
        "out",
        type=Path,
        help="where the events go, ending in .h5; any other name becomes the folder of a recording "
        "with the frames of the file; nothing may be there",
    )
    add_reading(parser)
    given = parser.parse_args(arguments)
    source, out = given.file, given.out
    try:
        if out.exists():
            raise ValueError(f"Expected no file at {out}, got one; name another place")
        if given.topic and of_frames(source, given.topic):
            if out.suffix.lower() in SUFFIXES:
                raise ValueError(f"Expected a folder for frames, got {out}; name one without .h5")
            written = write_clip(source, given.topic, out)
            said = f"{written.frames} frames of {', '.join(given.topic)}"
        else:
            said = convert_events(source, out, given)
    except (OSError, ValueError) as error:
        sys.exit(str(error))
    sys.stdout.write(f"{out}: {said}\n")


def of_frames(source: Path, topics: Sequence[str]) -> bool:
    """Whether all of these topics of a bag are of frames.

    Raises:
        ValueError: the file is no bag, or lacks one of them.
    """
    if not is_bag(source):
        raise ValueError(f"Expected a bag to look for topics in, got {source}; leave --topic out")
    return all(kind in IMAGES for kind in kinds_of(source, topics))


def convert_events(source: Path, out: Path, given: argparse.Namespace) -> str:
    """Write the events, and the frames where `out` is a folder; gives what is said of them.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it cannot be read, or not be written.
    """
    text = source / EVENTS_TEXT
    file = opened(text if text.is_file() else source, given)
    if out.suffix.lower() in SUFFIXES:
        rest = left_out(file, source)
        written = write_events(with_progress(file, f"writing {out}"), out, file)
    else:
        passing = partial(with_progress, what=f"writing {out}")
        written = write_recording(file, source, out, passing)
        rest = with_frames(written)
    sorted_in = f", {file.disorder} of them put in order" if file.disorder else ""
    return f"{written.events:,} events of {file.kind}{sorted_in}{rest}"


def left_out(file: OrderedFile, source: Path) -> str:
    """What is said where a file of events alone was wanted; frames still tell the sensor's size."""
    try:
        frame = next(foreign_frames(source, file.hints.topics), None)
    except ValueError:  # such that are not read here
        return "; its frames were left out"
    if frame is None:
        return ""
    file.fallback = frame.picture.shape[0], frame.picture.shape[1]
    return "; its frames were left out, a name without .h5 takes them along"


def with_frames(written: Written) -> str:
    """What is said of a recording's frames."""
    if not written.frames:
        return "; it has no frames of the sensor's own pixels"
    return f", {written.frames} frames"
