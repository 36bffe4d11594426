"""One sequence in the layout of DSEC: frames, their times, events and labels."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.content import content_hash, content_hashes
from eqs.files import short_hash, whole_numbers
from eqs.frames import IMAGE_SUFFIXES, checked_times, image_paths, image_size, read_image

EVENTS = Path("events/left/events.h5")
FRAMES = Path("images/left/distorted")
FRAME_TIMES = Path("images/timestamps.txt")
EXPOSURES = Path("images/left/exposure_timestamps.txt")
TRACKS = Path("object_detections/left/tracks.npy")
TRACK_FIELDS = ("t", "x", "y", "w", "h", "class_id")


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """What a sequence folder holds, with everything but frames and events already read.

    Convention: all times are on the recording's own clock, so a label's time equals its frame's.
    The frames are those in the distorted view, pixel for pixel that of the event sensor.

    Args:
        name: the sequence's name.
        folder: the sequence's folder.
        height: rows of the sensor and of the frames.
        width: columns of the sensor and of the frames.
        frame_times_us: middle of each frame's exposure, int64, rising, shape (frames,).
        frame_paths: the frames' files in order; empty where the recording has no frames.
        exposures_us: start and end of each frame's exposure, int64, shape (frames, 2), if known.
        tracks: labelled boxes sorted by time, with at least the fields t, x, y, w, h and class_id;
            None where the recording has no labels.
    """

    name: str
    folder: Path
    height: int
    width: int
    frame_times_us: NDArray[np.int64]
    frame_paths: tuple[Path, ...] = ()
    exposures_us: NDArray[np.int64] | None = None
    tracks: NDArray[np.void] | None = None

    @classmethod
    def load(
        cls, folder: Path | str, height: int | None = None, width: int | None = None
    ) -> Recording:
        """Read a sequence folder; without a given size the first frame tells the sensor's.

        Raises:
            FileNotFoundError: the folder does not exist.
            ValueError: the folder holds neither events nor frames, frames and timestamps do not
                fit, there is only one frame, the frames have another size than given, the size is
                unknown, or the labels cannot be read.
        """
        folder = Path(folder)
        if not folder.is_dir():
            raise FileNotFoundError(f"Expected a recording at {folder}, found none; set data.root")
        paths = frames_in(folder)
        if not paths and not (folder / EVENTS).exists():
            raise ValueError(
                f"Expected {EVENTS} or images in {FRAMES} in {folder}, found neither; "
                "set data.root to a folder of recordings in the layout of DSEC"
            )
        times_us = _frame_times(folder, len(paths))
        if paths:
            height, width = _frame_size(paths[0], height, width)
        if height is None or width is None:
            raise ValueError(
                f"Expected a sensor size for {folder}, which has no frames to tell it; "
                "set data.size"
            )
        return cls(
            name=folder.name,
            folder=folder,
            height=height,
            width=width,
            frame_times_us=times_us,
            frame_paths=paths,
            exposures_us=_exposures(folder, len(times_us)),
            tracks=_tracks(folder, times_us),
        )

    @property
    def events_path(self) -> Path:
        """The file of the recorded events."""
        return self.folder / EVENTS

    @property
    def frame_folder(self) -> Path:
        """The folder of the frames."""
        return self.folder / FRAMES

    @property
    def has_frames(self) -> bool:
        """Whether there are frames to simulate from."""
        return len(self.frame_paths) > 0

    def frames_hash(self) -> str:
        """What a simulator is fed with: the content of the frames, and their times."""
        return short_hash([self.frame_times_us.tolist(), content_hashes(self.frame_paths)])

    def content_hash(self) -> str:
        """Everything that a training, a score or a test takes from this recording, by content."""
        files = (self.events_path, self.folder / TRACKS)
        held = [content_hash(file) if file.is_file() else None for file in files]
        return short_hash([self.name, self.frames_hash(), *held])

    @property
    def has_labels(self) -> bool:
        """Whether boxes were labelled (perhaps none)."""
        return self.tracks is not None

    def read_frame(self, index: int) -> NDArray[Any]:
        """One frame, (height, width) grey or (height, width, 3) RGB, see `read_image`.

        Raises:
            ValueError: the file is no image, or one of another size.
        """
        path = self.frame_paths[index]
        frame = read_image(path)
        if frame.shape[:2] != (self.height, self.width):
            raise ValueError(
                f"Expected frames of {self.width}x{self.height} pixels, got "
                f"{frame.shape[1]}x{frame.shape[0]} in {path}; set data.size or replace it"
            )
        return frame


def frames_in(folder: Path) -> tuple[Path, ...]:
    """The frames of a sequence folder in their order; none where it has none.

    Raises:
        ValueError: their names admit two orders.
    """
    place = folder / FRAMES
    if not place.is_dir() or not any(p.suffix.lower() in IMAGE_SUFFIXES for p in place.iterdir()):
        return ()
    return tuple(image_paths(place))


def _frame_times(folder: Path, frames: int) -> NDArray[np.int64]:
    path = folder / FRAME_TIMES
    if not path.exists():
        if frames:
            raise ValueError(
                f"Expected {FRAME_TIMES} beside the {frames} frames of {folder}, found none; "
                "add the time of each frame in microseconds, one a line"
            )
        return np.empty(0, np.int64)
    times_us = whole_numbers(path).reshape(-1)
    if frames == 1 or len(times_us) == 1:
        raise ValueError(
            f"Expected at least two frames in {folder}, got one; a single frame moves nothing"
        )
    if frames and len(times_us) != frames:
        raise ValueError(
            f"Expected one timestamp per frame in {folder}, got {len(times_us)} lines in "
            f"{FRAME_TIMES} and {frames} frames; complete the recording"
        )
    if len(times_us) and times_us[0] < 0:
        raise ValueError(
            f"Expected times of zero or more in {path}, got {times_us[0]} us; add {-times_us[0]} "
            "to the times of frames, labels and events"
        )
    try:
        return checked_times(times_us, len(times_us))
    except ValueError as error:
        raise ValueError(f"{error} (in {path})") from error


def _exposures(folder: Path, frames: int) -> NDArray[np.int64] | None:
    path = folder / EXPOSURES
    if not path.exists():
        return None
    exposures_us = whole_numbers(path)
    if exposures_us.shape != (frames, 2):
        raise ValueError(
            f"Expected start and end of {frames} exposures in {path}, got numbers of shape "
            f"{exposures_us.shape}; complete the file or remove it"
        )
    return exposures_us


def _frame_size(path: Path, height: int | None, width: int | None) -> tuple[int, int]:
    found_height, found_width = image_size(path)
    if (height or found_height, width or found_width) != (found_height, found_width):
        raise ValueError(
            f"Expected frames of {width}x{height} pixels, got {found_width}x{found_height} in "
            f"{path}; set data.size"
        )
    return found_height, found_width


def _tracks(folder: Path, frame_times_us: NDArray[np.int64]) -> NDArray[np.void] | None:
    path = folder / TRACKS
    if not path.exists():
        return None
    try:
        tracks: NDArray[np.void] = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise ValueError(
            f"Expected a label array in {path}, got: {error}; replace the damaged file"
        ) from error
    missing = [name for name in TRACK_FIELDS if name not in (tracks.dtype.names or ())]
    if missing:
        raise ValueError(
            f"Expected labels with the fields {', '.join(TRACK_FIELDS)} in {path}, got none named "
            f"{', '.join(missing)}; replace the file"
        )
    if tracks.ndim != 1 or not all(np.isfinite(tracks[name]).all() for name in TRACK_FIELDS):
        raise ValueError(
            f"Expected a row of labels with finite numbers in {path}, got shape {tracks.shape} "
            "or NaN; replace the file"
        )
    if len(tracks) and not len(frame_times_us):
        raise ValueError(
            f"Expected {FRAME_TIMES} beside the labels of {folder}, found none; add the time of "
            "each labelled frame in microseconds, one a line"
        )
    return tracks[np.argsort(tracks["t"], kind="stable")]
