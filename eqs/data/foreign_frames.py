"""Frames that lie beside the events in the files of other programs."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Iterator, Sequence
from decimal import Decimal, InvalidOperation
from pathlib import Path

import h5py
import numpy as np
from PIL import Image

from eqs.data.bag_frames import bag_frames
from eqs.data.frame import Frame
from eqs.events.aedat4 import VERSION, Aedat4
from eqs.events.bag import BAGS, is_bag_folder
from eqs.events.formats import first_bytes
from eqs.events.hdf5 import HDF5, require_stored, whole_hdf5
from eqs.events.tables import DAMAGED_ZIP, ZIP, microseconds

EVENTS_TEXT, IMAGES_TEXT = "events.txt", "images.txt"
# Where programs put frames and their times, and the unit of those; v2e's are whole numbers.
DATASETS = {
    "davis/left/image_raw": ("davis/left/image_raw_ts", "s"),
    "frame": ("frame_ts", "us"),
}


def foreign_frames(path: Path, topics: Sequence[str] = ()) -> Iterator[Frame]:
    """The frames of an event file in its order; none where it has none of the same pixels.

    M3ED's frames are those of another camera and are left alone.

    Args:
        path: an AEDAT 4 file, a bag, an HDF5 file of MVSEC or v2e, or a folder or a zip with
            `images.txt`; any other file has none.
        topics: topics of a bag that are meant, where it holds several.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is damaged, has frames of several topics or of a kind that is not read.
    """
    if path.is_dir() and not is_bag_folder(path):
        yield from _listed(path, lambda name: (path / name).read_bytes())
        return
    first = b"" if path.is_dir() else first_bytes(path)
    if path.is_dir() or first.startswith(BAGS):
        yield from bag_frames(path, topics)
    elif first.startswith(VERSION):
        yield from _of_aedat4(path)
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
