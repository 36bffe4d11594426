"""Clips stored as a video file."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eqs.extras import needed
from eqs.frames.image import require_opaque

if TYPE_CHECKING:
    import av


class VideoFile:
    """A video, decoded a few frames at a time, with the times that the file gives its frames.

    Convention: a frame's time is its presentation time in whole microseconds, rounded down, so
    irregular times stay irregular. Colour is decoded to RGB, grey videos stay grey; what has more
    than 8 bits becomes float32 with levels from 0 to 255. Frames are turned as the file says.

    Args:
        path: a file that FFmpeg can read.
        chunk: frames to hold in memory at once.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: PyAV, the optional dependency `video`, is not installed; or, while iterating,
            the file has no video that can be decoded.
    """

    def __init__(self, path: Path | str, chunk: int = 8) -> None:
        """Check that the file and its decoder are there; nothing is decoded yet."""
        self.path, self.chunk = Path(path), chunk
        if not self.path.is_file():
            raise FileNotFoundError(f"Expected a video at {self.path}, found none; set frames")
        with needed("video", f"to decode {self.path} (a folder of images needs none)"):
            import av  # noqa: F401

    def __len__(self) -> int:
        """Number of frames that the file states, 0 where it states none."""
        import av

        try:
            with av.open(str(self.path)) as container:
                return container.streams.video[0].frames if container.streams.video else 0
        except av.FFmpegError:
            return 0

    @property
    def duration_us(self) -> int:
        """How long the file says that it plays, 0 where it does not say."""
        import av

        try:
            with av.open(str(self.path)) as container:
                return int(container.duration or 0) * 1_000_000 // av.time_base
        except av.FFmpegError:
            return 0

    def __iter__(self) -> Iterator[tuple[NDArray[Any], NDArray[np.int64]]]:
        """Chunks of frames with their times, from the first to the last."""
        images: list[NDArray[Any]] = []
        times: list[int] = []
        for image, time_us in self._decoded():
            images.append(image)
            times.append(time_us)
            if len(images) == self.chunk:
                yield np.stack(images), np.array(times, np.int64)
                images, times = [], []
        if images:
            yield np.stack(images), np.array(times, np.int64)

    def _decoded(self) -> Iterator[tuple[NDArray[Any], int]]:
        import av

        try:
            with av.open(str(self.path)) as container:
                if not container.streams.video:
                    raise ValueError(f"Expected a video stream in {self.path}, got none")
                for frame in container.decode(video=0):
                    if frame.pts is None or frame.time_base is None:
                        raise ValueError(
                            f"Expected a time for every frame of {self.path}, got none; convert "
                            "it to a container that keeps times, such as MP4"
                        )
                    yield upright(picture(frame, self.path), frame.rotation), time_of(frame)
        except av.FFmpegError as error:
            raise ValueError(
                f"Expected {self.path} to be a video that FFmpeg decodes, got: {error}; replace "
                "the damaged file or convert it to images"
            ) from error


def time_of(frame: av.VideoFrame) -> int:
    """When a frame is shown, whole microseconds, rounded down."""
    assert frame.pts is not None
    assert frame.time_base is not None
    return math.floor(frame.pts * frame.time_base * 1_000_000)


def picture(frame: av.VideoFrame, path: Path) -> NDArray[Any]:
    """A decoded frame, grey `(H, W)` or RGB `(H, W, 3)`, at its full depth, levels 0 to 255.

    Raises:
        ValueError: some of it is transparent, or it has more than 16 bits.
    """
    parts = frame.format.components
    if any(part.is_alpha for part in parts):
        require_opaque(frame.to_ndarray(format="rgba")[..., 3] == 255, path)
    grey = frame.format.name.startswith("gray")
    bits = max(part.bits for part in parts)
    if bits > 16:
        raise ValueError(f"Expected a video of at most 16 bits, got {bits} in {path}; convert it")
    if bits <= 8:
        shallow: NDArray[Any] = frame.to_ndarray(format="gray" if grey else "rgb24")
        return shallow
    if grey:  # as it is stored: a conversion would shift its bits and leave white grey
        kind = ">u2" if frame.format.name.endswith("be") else "<u2"
        plane = frame.planes[0]
        rows = np.frombuffer(bytes(plane), kind).reshape(plane.height, -1)
        values, most = rows[:, : frame.width], 2**bits - 1
    else:
        values, most = frame.to_ndarray(format="rgb48le"), 2**16 - 1
    levels: NDArray[np.float32] = (values.astype(np.float64) * (255 / most)).astype(np.float32)
    return levels


def upright(frame: NDArray[Any], rotation: int) -> NDArray[Any]:
    """A frame as it is to be shown, which the file states in degrees, against the clock.

    Raises:
        ValueError: it is no quarter turn.
    """
    if rotation % 90:
        raise ValueError(f"Expected a video turned by quarters, got {rotation} degrees; turn it")
    return np.ascontiguousarray(np.rot90(frame, rotation // 90))
