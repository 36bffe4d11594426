"""Boxes as other programs write them: DSEC and Prophesee arrays, COCO files, YOLO text.

Convention: all become rows with the fields t (microseconds), x, y (left and top edge), w, h
(pixels) and class_id, the number that the file gives the class; a protocol says what it counts as.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

ROW = [("t", np.int64), *((name, np.float32) for name in "xywh"), ("class_id", np.int64)]
FIELDS = tuple(name for name, _ in ROW)
TIME_NAMES = ("t", "ts")  # of label arrays; Prophesee's older ones say ts


@dataclass(frozen=True, kw_only=True)
class LabelledFrames:
    """The frames that labels may belong to.

    Args:
        name: the recording's name.
        stems: names of the frames without their endings.
        times_us: their times, int64.
        height: rows of the sensor.
        width: columns of the sensor.
    """

    name: str
    stems: Sequence[str]
    times_us: NDArray[np.int64]
    height: int
    width: int

    def time_of(self, image: str, source: Path) -> int:
        """The time of the frame with an image's name.

        Raises:
            ValueError: there is no such frame.
        """
        stem = Path(image).stem
        if stem not in self.stems:
            raise ValueError(
                f"Expected labels of frames of {self.name}, as {', '.join(self.stems[:2])}, got "
                f"one of {image} in {source}; set data.frames or remove the label"
            )
        return int(self.times_us[self.stems.index(stem)])


class LabelFiles(Protocol):
    """Knows where the labels of a recording lie and reads them."""

    def paths(self, root: Path, name: str) -> tuple[Path, ...]:
        """The files of a recording's labels."""

    def read(self, paths: Sequence[Path], frames: LabelledFrames) -> NDArray[np.void]:
        """The rows of these files, type `ROW`."""


@dataclass(frozen=True, kw_only=True)
class ArrayLabels:
    """One NumPy array for each recording, with named fields, as of DSEC-Detection or Prophesee.

    Args:
        path: the file below the root, with `{name}` for the recording's name.
    """

    path: str

    def paths(self, root: Path, name: str) -> tuple[Path, ...]:
        """The file."""
        return (root / self.path.format(name=name),)

    def read(self, paths: Sequence[Path], frames: LabelledFrames) -> NDArray[np.void]:
        """The rows of the array.

        Raises:
            ValueError: the file holds no such array.
        """
        return label_array(paths[0])


@dataclass(frozen=True, kw_only=True)
class CocoLabels:
    """A COCO file for each recording, or one for all of them.

    Convention: an image belongs to the frame of its name. In a file for all recordings the image's
    folder is the recording's, as in `night_1/000012.png`. Crowds are left out, as mAP ignores them.

    Args:
        path: the file below the root, with `{name}` for the recording's name where each has one.
    """

    path: str

    def paths(self, root: Path, name: str) -> tuple[Path, ...]:
        """The file."""
        return (root / self.path.format(name=name),)

    def read(self, paths: Sequence[Path], frames: LabelledFrames) -> NDArray[np.void]:
        """The boxes of the recording's images.

        Raises:
            ValueError: the file is no COCO file, or names an image that is no frame.
        """
        (path,) = paths
        try:
            content = json.loads(path.read_text())
            images = {each["id"]: str(each["file_name"]) for each in content["images"]}
            boxes = [
                (images[each["image_id"]], each["bbox"], int(each["category_id"]))
                for each in content["annotations"]
                if not each.get("iscrowd", 0)
            ]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise ValueError(
                f"Expected a COCO file with images and annotations in {path}, got: {error!r}; set "
                "data.labels.path"
            ) from error
        if "{name}" not in self.path:
            boxes = [each for each in boxes if frames.name in Path(each[0]).parts[:-1]]
        times = [frames.time_of(image, path) for image, _, _ in boxes]
        try:
            rows = [(time, *each[1], each[2]) for time, each in zip(times, boxes, strict=True)]
            found = np.array(rows, ROW)
        except (TypeError, ValueError) as error:
            raise ValueError(
                f"Expected boxes of left, top, width and height in {path}, got: {error}; correct it"
            ) from error
        return finite(found, path)


@dataclass(frozen=True, kw_only=True)
class YoloLabels:
    """A text file for each frame, with lines of class, centre x, centre y, width and height.

    Convention: lengths are shares of the image's width and height. A frame without a file has no
    box; whether that means no object is said by `exhaustive_labels`.

    Args:
        folder: the files' folder below the root, with `{name}` for the recording's name.
    """

    folder: str

    def paths(self, root: Path, name: str) -> tuple[Path, ...]:
        """The files, `classes.txt` left out."""
        found = sorted((root / self.folder.format(name=name)).glob("*.txt"))
        return tuple(path for path in found if path.name != "classes.txt")

    def read(self, paths: Sequence[Path], frames: LabelledFrames) -> NDArray[np.void]:
        """The boxes of all files.

        Raises:
            ValueError: a line says something else, or a file belongs to no frame.
        """
        rows: list[tuple[Any, ...]] = []
        for path in paths:
            time = frames.time_of(path.name, path)
            lines = [line for line in path.read_text().splitlines() if line.strip()]
            rows += [(time, *self._box(line, frames, path)) for line in lines]
        return np.array(rows, ROW)

    def _box(self, line: str, frames: LabelledFrames, path: Path) -> tuple[float, ...]:
        try:
            number, x, y, w, h = line.split()[:5]
            values = [float(each) for each in (x, y, w, h)]
            kind = int(number)
        except ValueError as error:
            raise ValueError(
                f"Expected lines of class, centre x, centre y, width and height in {path}, got "
                f"{line!r}; correct it"
            ) from error
        if not all(0 <= value <= 1 for value in values):
            raise ValueError(
                f"Expected shares of width and height between 0 and 1 in {path}, got {line!r}; "
                "divide pixels by the size of the image"
            )
        centre_x, centre_y, width, height = values
        return (
            (centre_x - width / 2) * frames.width,
            (centre_y - height / 2) * frames.height,
            width * frames.width,
            height * frames.height,
            kind,
        )


def label_array(path: Path) -> NDArray[np.void]:
    """Rows of type `ROW` from an array with such fields and any others beside, in its order.

    Raises:
        ValueError: the file holds no such array, or numbers that are not finite.
    """
    try:
        held: NDArray[np.void] = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise ValueError(
            f"Expected a label array in {path}, got: {error}; replace the damaged file"
        ) from error
    names = held.dtype.names or ()
    time = next((name for name in TIME_NAMES if name in names), "t")
    missing = [name for name in (time, *FIELDS[1:]) if name not in names]
    if missing:
        raise ValueError(
            f"Expected labels with the fields {', '.join(FIELDS)} in {path}, got none named "
            f"{', '.join(missing)}; replace the file"
        )
    if held.ndim != 1:
        raise ValueError(
            f"Expected a row of labels in {path}, got an array of shape {held.shape}; replace it"
        )
    finite(held, path)
    rows = np.empty(len(held), ROW)
    for name in FIELDS:
        rows[name] = held[time if name == "t" else name]
    return rows


def finite(rows: NDArray[np.void], path: Path) -> NDArray[np.void]:
    """The rows, of which every number is finite.

    Raises:
        ValueError: one is not.
    """
    for name in rows.dtype.names or ():
        values = rows[name]
        if values.dtype.kind == "f" and not np.isfinite(values).all():
            raise ValueError(
                f"Expected labels of finite numbers in {path}, got {name} with infinity or NaN; "
                "replace the file"
            )
    return rows
