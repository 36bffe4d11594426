"""Clips stored as a folder of images."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.frames.checks import checked_times
from eqs.frames.image import IMAGE_SUFFIXES, read_image
from eqs.frames.order import frame_order


def image_paths(folder: Path | str) -> list[Path]:
    """The images of a folder in the order of their numbers, see `frame_order`.

    Raises:
        FileNotFoundError: there is no such folder, or no image in it.
        ValueError: their names admit two orders.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileNotFoundError(f"Expected a folder of frames, got {folder}, which is none")
    paths = [path for path in folder.iterdir() if path.suffix.lower() in IMAGE_SUFFIXES]
    if not paths:
        raise FileNotFoundError(
            f"Expected images ({', '.join(IMAGE_SUFFIXES)}) in {folder}, got none"
        )
    return frame_order(paths)


class FrameFolder:
    """A clip on disk, read a few frames at a time.

    Convention: frames come in the order of the numbers in their names and belong to the times in
    that order.

    Args:
        images: folder of images of one size and depth, all grey or all in colour, or their files in
            order.
        timestamps_us: time of each frame, strictly increasing, int64 microseconds.
        chunk: frames to hold in memory at once.
        white: level that is white in floating images.

    Raises:
        FileNotFoundError: the folder is missing or holds no image.
        ValueError: the number of times differs from that of images, or they do not increase.
    """

    def __init__(
        self,
        images: Path | str | Sequence[Path],
        timestamps_us: NDArray[np.int64],
        chunk: int = 8,
        white: float | None = None,
    ) -> None:
        """List the images and check that the times fit them."""
        if chunk < 1:
            raise ValueError(f"Expected at least one frame per chunk, got {chunk}; set chunk=8")
        self.paths = image_paths(images) if isinstance(images, Path | str) else list(images)
        self.chunk, self.white = chunk, white
        given = np.shape(timestamps_us)
        if given != (len(self.paths),):
            raise ValueError(
                f"Expected one time for each of the {len(self.paths)} images in "
                f"{self.paths[0].parent}, got times shaped {given}; check the timestamp file "
                "beside the images"
            )
        self.timestamps_us = checked_times(timestamps_us, len(self.paths))

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.paths)

    @cached_property
    def first(self) -> NDArray[Any]:
        """The first frame, which those that follow must be like."""
        return read_image(self.paths[0], self.white)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of a frame, `(H, W)` grey or `(H, W, 3)` RGB, as the first image has it."""
        return self.first.shape

    @property
    def duration_us(self) -> int:
        """Time from the first to the last frame."""
        return int(self.timestamps_us[-1] - self.timestamps_us[0])

    def read(self, start: int, stop: int) -> NDArray[Any]:
        """Frames `[start, stop)` as one array, uint8 or, where they are deeper, float32.

        Raises:
            ValueError: an image cannot be read or differs from the first in size, colour or depth.
        """
        frames = [read_image(path, self.white) for path in self.paths[start:stop]]
        for path, frame in zip(self.paths[start:stop], frames, strict=True):
            if (frame.shape, frame.dtype) != (self.shape, self.first.dtype):
                raise ValueError(
                    f"Expected frames of one kind, got {frame.shape} of {frame.dtype} in {path} "
                    f"after {self.shape} of {self.first.dtype}; a clip is all grey or all RGB, of "
                    "one height, width and depth"
                )
        return np.stack(frames)

    def __iter__(self) -> Iterator[tuple[NDArray[Any], NDArray[np.int64]]]:
        """Chunks of frames with their times, from the first to the last."""
        for start in range(0, len(self), self.chunk):
            stop = min(start + self.chunk, len(self))
            yield self.read(start, stop), self.timestamps_us[start:stop]
