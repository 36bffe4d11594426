"""Writes what a file of another program holds as a recording in the layout of DSEC."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from eqs.data.foreign_frames import foreign_frames
from eqs.data.frame import Frame
from eqs.data.places import EVENTS, EXPOSURES, FRAME_TIMES, FRAMES
from eqs.events import Events, EventWriter
from eqs.events.ordered import OrderedFile
from eqs.files import complete_folder, write_text
from eqs.frames import checked_times
from eqs.frames.times import TIMES as CLIP_TIMES

Passing = Callable[[Iterable[Events]], Iterable[Events]]


class Written(NamedTuple):
    """What was written.

    Args:
        events: how many events.
        frames: how many frames.
        extent_us: the first event's time and the last one's, if there is any.
    """

    events: int
    frames: int = 0
    extent_us: tuple[int, int] | None = None


def write_events(pieces: Iterable[Events], out: Path, file: OrderedFile) -> Written:
    """Write a file's events in the layout of DSEC.

    Args:
        pieces: the events of `file`, as they pass.
        out: where the HDF5 file goes.
        file: what is read, which says in the end how long its camera watched.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it cannot be read, or not be written.
    """
    rest = iter(pieces)
    first = next(rest)
    count, extent_us = 0, None
    with EventWriter(out, height=first.height, width=first.width) as writer:
        for piece in chain([first], rest):
            writer.append(piece)
            count += len(piece)
            if piece.extent_us and len(piece):
                start_us = extent_us[0] if extent_us else int(piece.t[0])
                extent_us = start_us, int(piece.t[-1])
        writer.span_us = file.span_us
    return Written(count, extent_us=extent_us)


def write_recording(file: OrderedFile, source: Path, out: Path, passing: Passing = iter) -> Written:
    """Write the events and frames of a file as a recording, which appears when it is complete.

    The frames have the sensor's pixels, and tell its size where the file does not.

    Args:
        file: the events.
        source: the file or folder that holds events and frames.
        out: the recording's folder; nothing may be there.
        passing: what the pieces of events pass through on their way.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it cannot be read, or frames and events are of several sizes or clocks.

    Example:
        >>> import tempfile
        >>> from eqs.data import Recording
        >>> from eqs.events.hints import Hints
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     source, out = Path(folder) / "source", Path(folder) / "out"
        ...     source.mkdir()
        ...     for name in ("a.png", "b.png"):
        ...         Image.new("L", (8, 6)).save(source / name)
        ...     _ = write_text("0.02 a.png", source / "images.txt")
        ...     with (source / "images.txt").open("a") as lines:
        ...         _ = lines.writelines([chr(10), "0.05 b.png"])
        ...     _ = write_text("0.03 7 5 1", source / "events.txt")
        ...     events = OrderedFile(source / "events.txt", Hints(order="txyp"))
        ...     written = write_recording(events, source, out)
        ...     written.frames, Recording.load(out).frame_times_us.tolist()
        (2, [20000, 50000])
    """
    with complete_folder(out) as folder:
        frames = _checked(foreign_frames(source, file.hints.topics), source)
        first = next(frames, None)
        if first is not None:
            file.fallback = first.picture.shape[0], first.picture.shape[1]
            _write_frames(chain([first], frames), folder, source)
        written = write_events(_of_size(passing(file), first, source), folder / EVENTS, file)
        if first is None:
            return written
        times_us = np.loadtxt(folder / FRAME_TIMES, dtype=np.int64, ndmin=1)
        _check_clocks(times_us, written.extent_us, source)
    return written._replace(frames=len(times_us))


def write_clip(source: Path, topics: Sequence[str], out: Path) -> Written:
    """Write the frames of a bag as a folder of PNG with their times, as `simulate frames=` takes.

    Args:
        source: the bag.
        topics: the topic of frames.
        out: the folder, which appears when it is complete; nothing may be there.

    Raises:
        ValueError: the bag is damaged, or has no two such frames at times that increase.
    """
    with complete_folder(out) as folder:
        try:
            times_us = _save_frames(_checked(foreign_frames(source, topics), source), folder)
        except ValueError as error:
            raise ValueError(f"{error} (the frames of {', '.join(topics)})") from error
        _write_times(times_us, folder / CLIP_TIMES)
    return Written(0, frames=len(times_us))


def _checked(frames: Iterator[Frame], source: Path) -> Iterator[Frame]:
    """Frames that are all of one shape."""
    shape = None
    for frame in frames:
        shape = shape or frame.picture.shape
        if frame.picture.shape != shape:
            raise ValueError(
                f"Expected frames of one shape in {source}, got {shape} and {frame.picture.shape}; "
                "record one size, or convert the events alone, to a name that ends in .h5"
            )
        yield frame


def _write_frames(frames: Iterable[Frame], folder: Path, source: Path) -> None:
    """Write frames, their times and, where all are known, their exposures where DSEC has them."""
    exposures = []

    def passing() -> Iterator[Frame]:
        for frame in frames:
            exposures.append(frame.exposure_us)
            yield frame

    try:
        times_us = _save_frames(passing(), folder / FRAMES)
    except ValueError as error:
        raise ValueError(f"{error} (the frames of {source}; OUT.h5 leaves them out)") from error
    _write_times(times_us, folder / FRAME_TIMES)
    known = [f"{each[0]}, {each[1]}\n" for each in exposures if each is not None]
    if len(known) == len(times_us):
        write_text("".join(known), folder / EXPOSURES)


def _save_frames(frames: Iterable[Frame], folder: Path) -> list[int]:
    """Write frames as PNG, numbered from zero; gives their times.

    Raises:
        ValueError: there is one only, or the times are below zero or do not increase.
    """
    folder.mkdir(parents=True, exist_ok=True)
    times_us = []
    for index, frame in enumerate(frames):
        Image.fromarray(np.ascontiguousarray(frame.picture)).save(folder / f"{index:06d}.png")
        times_us.append(frame.time_us)
    if len(times_us) < 2:
        count = "one" if times_us else "none"
        raise ValueError(f"Expected at least two frames, got {count}")
    if times_us[0] < 0:
        raise ValueError(f"Expected times of zero or more, got {times_us[0]} us; shift them")
    checked_times(np.array(times_us), len(times_us))
    return times_us


def _write_times(times_us: Iterable[int], path: Path) -> None:
    write_text("".join(f"{time_us}\n" for time_us in times_us), path)


def _of_size(pieces: Iterable[Events], frame: Frame | None, source: Path) -> Iterator[Events]:
    """The pieces, once it is clear that the sensor has the frame's size."""
    for piece in pieces:
        if frame is not None and (piece.height, piece.width) != frame.picture.shape[:2]:
            height, width = frame.picture.shape[:2]
            raise ValueError(
                f"Expected frames of the sensor's {piece.width}x{piece.height} pixels in {source}, "
                f"got {width}x{height}; convert the events alone, to a name that ends in .h5"
            )
        yield piece


def _check_clocks(
    times_us: NDArray[np.int64], extent_us: tuple[int, int] | None, source: Path
) -> None:
    """Refuse frames none of which was taken while there were events."""
    first, last = int(times_us[0]), int(times_us[-1])
    if extent_us and (last < extent_us[0] or first > extent_us[1]):
        raise ValueError(
            f"Expected frames and events of one clock in {source}, got frames from {first} to "
            f"{last} us and events from {extent_us[0]} to {extent_us[1]} us; convert the events "
            "alone, to a name that ends in .h5"
        )
