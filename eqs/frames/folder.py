"""Clips stored as a folder of images."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from eqs.frames.checks import checked_times

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
GREY_MODES = ("L", "1")
COLOUR_MODES = ("RGB", "RGBA", "P")


def image_paths(folder: Path | str) -> list[Path]:
    """The images of a folder in the order of their names.

    Raises:
        FileNotFoundError: there is no such folder, or no image in it.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileNotFoundError(f"Expected a folder of frames, got {folder}, which is none")
    paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in IMAGE_SUFFIXES)
    if not paths:
        raise FileNotFoundError(
            f"Expected images ({', '.join(IMAGE_SUFFIXES)}) in {folder}, got none"
        )
    return paths


def read_image(path: Path | str) -> NDArray[np.uint8]:
    """Read an 8-bit image as grey `(H, W)` or RGB `(H, W, 3)`.

    Raises:
        ValueError: the file is no readable 8-bit image.
    """
    try:
        with Image.open(path) as image:
            if image.mode not in GREY_MODES + COLOUR_MODES:
                raise ValueError(
                    f"Expected an 8-bit grey or colour image, got mode {image.mode} in {path}; "
                    "convert it to 8 bits first"
                )
            return np.asarray(image.convert("L" if image.mode in GREY_MODES else "RGB"))
    except (UnidentifiedImageError, OSError, SyntaxError) as error:
        raise ValueError(f"Expected a readable image, got {path}: {error}") from error


class FrameFolder:
    """A clip on disk, read a few frames at a time.

    Convention: frames come in the order of their file names and belong to the times in that order.

    Args:
        folder: folder of images of one size, all grey or all in colour.
        timestamps_us: time of each frame, strictly increasing, int64 microseconds.
        chunk: frames to hold in memory at once.

    Raises:
        FileNotFoundError: the folder is missing or holds no image.
        ValueError: the number of times differs from that of images, or they do not increase.
    """

    def __init__(
        self, folder: Path | str, timestamps_us: NDArray[np.int64], chunk: int = 8
    ) -> None:
        """List the images and check that the times fit them."""
        if chunk < 1:
            raise ValueError(f"Expected at least one frame per chunk, got {chunk}; set chunk=8")
        self.paths = image_paths(folder)
        self.chunk = chunk
        given = np.shape(timestamps_us)
        if given != (len(self.paths),):
            raise ValueError(
                f"Expected one time for each of the {len(self.paths)} images in {folder}, got "
                f"times shaped {given}; check the timestamp file beside the images"
            )
        self.timestamps_us = checked_times(timestamps_us, len(self.paths))

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.paths)

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Shape of a frame, `(H, W)` grey or `(H, W, 3)` RGB, as the first image has it."""
        return read_image(self.paths[0]).shape

    @property
    def duration_us(self) -> int:
        """Time from the first to the last frame."""
        return int(self.timestamps_us[-1] - self.timestamps_us[0])

    def read(self, start: int, stop: int) -> NDArray[np.uint8]:
        """Frames `[start, stop)` as one array.

        Raises:
            ValueError: an image cannot be read or differs in size or colour from the first.
        """
        frames = [read_image(path) for path in self.paths[start:stop]]
        for path, frame in zip(self.paths[start:stop], frames, strict=True):
            if frame.shape != self.shape:
                raise ValueError(
                    f"Expected frames of one size, got {frame.shape} in {path} after "
                    f"{self.shape}; a clip is all grey or all RGB, of one height and width"
                )
        return np.stack(frames)

    def __iter__(self) -> Iterator[tuple[NDArray[Any], NDArray[np.int64]]]:
        """Chunks of frames with their times, from the first to the last."""
        for start in range(0, len(self), self.chunk):
            stop = min(start + self.chunk, len(self))
            yield self.read(start, stop), self.timestamps_us[start:stop]
