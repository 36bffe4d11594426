"""Frames that lie beside the events in the files of other programs."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from eqs.events.aedat4 import VERSION, Aedat4
from eqs.events.formats import first_bytes
from eqs.events.hdf5 import HDF5, require_stored, whole_hdf5
from eqs.events.ros import BAGS, IMAGE, Bag, Message
from eqs.events.tables import DAMAGED_ZIP, ZIP, microseconds

EVENTS_TEXT, IMAGES_TEXT = "events.txt", "images.txt"
# Where programs put frames and their times, and the unit of those; v2e's are whole numbers.
DATASETS = {
    "davis/left/image_raw": ("davis/left/image_raw_ts", "s"),
    "frame": ("frame_ts", "us"),
}
ENCODINGS = {"mono8": 1, "8UC1": 1, "rgb8": 3, "bgr8": 3}


@dataclass(frozen=True, eq=False)
class Frame:
    """A picture of the event sensor's own pixels.

    Args:
        time_us: middle of the exposure, or the only time that is known.
        picture: grey `(H, W)` or RGB `(H, W, 3)`, of 8 or 16 bits.
        exposure_us: start and stop of the exposure, where it is known.
    """

    time_us: int
    picture: NDArray[Any]
    exposure_us: tuple[int, int] | None = None


def foreign_frames(path: Path) -> Iterator[Frame]:
    """The frames of an event file in its order; none where it has none of the same pixels.

    M3ED's frames are those of another camera and are left alone.

    Args:
        path: an AEDAT 4 file, a bag, an HDF5 file of MVSEC or v2e, or a folder or a zip with
            `images.txt`; any other file has none.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is damaged, has frames of several topics or of a kind that is not read.
    """
    if path.is_dir():
        yield from _listed(path, lambda name: (path / name).read_bytes())
        return
    first = first_bytes(path)
    if first.startswith(VERSION):
        yield from _of_aedat4(path)
    elif first.startswith(BAGS):
        yield from _of_bag(path)
    elif first.startswith(HDF5):
        yield from _of_hdf5(path)
    elif first.startswith(ZIP) and path.suffix.lower() == ".zip":
        try:
            with zipfile.ZipFile(path) as archive:
                inside = [name for name in archive.namelist() if Path(name).name == IMAGES_TEXT]
                root = inside[0].removesuffix(IMAGES_TEXT) if inside else ""
                yield from _listed(path, lambda name: archive.read(root + name))
        except (*DAMAGED_ZIP, KeyError) as error:
            raise ValueError(f"Expected a whole zip at {path}, got: {error}") from error


def _of_aedat4(path: Path) -> Iterator[Frame]:
    file = Aedat4(path)
    if any(stream.kind == "FRME" for stream in file.streams):
        for packet in file.packets("FRME"):
            start, stop, picture = file.frame(packet)
            yield Frame((start + stop) // 2, picture, (start, stop))


def _of_bag(path: Path) -> Iterator[Frame]:
    with Bag(path) as bag:
        topics = bag.topics(IMAGE)
        if len(topics) > 1:
            raise ValueError(
                f"Expected one topic of frames ({IMAGE[0]}) in {path}, got {bag.listed()}; write "
                "the one that is meant into a bag of its own, with the events"
            )
        for topic in topics:
            for raw in bag.messages(topic):
                yield _message(Message(raw, ros1=bag.ros1), path)


def _message(message: Message, path: Path) -> Frame:
    """The frame of one message of `sensor_msgs/Image`."""
    height, width = message.header()
    encoding = message.text()
    if encoding not in ENCODINGS:
        raise ValueError(
            f"Expected frames of {', '.join(ENCODINGS)} in {path}, got {encoding}; convert them"
        )
    message.number(1)
    step, channels = message.number(4), ENCODINGS[encoding]
    pixels = np.frombuffer(message.bytes(), np.uint8)
    if pixels.size != height * step or step < width * channels:
        raise ValueError(
            f"Expected frames of {width}x{height} pixels in {path}, got {pixels.size} bytes in "
            f"rows of {step}; record it again"
        )
    picture = pixels.reshape(height, step)[:, : width * channels].reshape(height, width, channels)
    if encoding == "bgr8":
        picture = picture[..., ::-1]
    return Frame(message.stamp_us, picture[..., 0] if channels == 1 else picture)


def _of_hdf5(path: Path) -> Iterator[Frame]:
    with whole_hdf5(path), h5py.File(path) as file:
        for place, (times_place, unit) in DATASETS.items():
            frames, times = file.get(place), file.get(times_place)
            if isinstance(frames, h5py.Dataset) and isinstance(times, h5py.Dataset):
                for each in (frames, times):
                    require_stored(each, path)
                if len(frames) != len(times) or frames.dtype != np.uint8 or frames.ndim != 3:
                    raise ValueError(
                        f"Expected grey frames of 8 bits and a time for each in {path}, got "
                        f"{frames.dtype} of shape {frames.shape} and {len(times)} times; convert it"
                    )
                times_us = microseconds(times[:], unit, path).tolist()
                for index, time_us in enumerate(times_us):
                    yield Frame(time_us, frames[index])


def _listed(path: Path, read: Callable[[str], bytes]) -> Iterator[Frame]:
    """The frames that `images.txt` lists: seconds and a name a line."""
    try:
        lines = read(IMAGES_TEXT).decode("utf-8", "replace").splitlines()
    except (KeyError, FileNotFoundError):
        return
    for line in lines:
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        seconds, _, name = line.strip().partition(" ")
        try:
            time_us = int(Decimal(seconds) * 1_000_000)
            with Image.open(io.BytesIO(read(name.strip()))) as image:
                picture = np.asarray(image)
                mode = image.mode
        except (InvalidOperation, OverflowError, OSError, KeyError, SyntaxError) as error:
            raise ValueError(
                f"Expected seconds and an image in the line {line!r} of {IMAGES_TEXT} in {path}, "
                f"got: {error}"
            ) from error
        if mode not in ("L", "RGB"):
            raise ValueError(
                f"Expected grey or RGB frames of 8 bits in {path}, got mode {mode} in {name}; "
                "convert them"
            )
        yield Frame(time_us, picture)
