"""One sequence in the layout of DSEC: frames, their times, events and labels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.content import content_hash, content_hashes
from eqs.data.label_files import label_array
from eqs.data.places import CALIBRATION, EVENTS, FRAME_TIMES, FRAMES, Places
from eqs.files import short_hash, whole_numbers
from eqs.frames import (
    IMAGE_SUFFIXES,
    FrameFolder,
    checked_times,
    image_paths,
    image_size,
    read_image,
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """What belongs to one sequence, with everything but frames and events already read.

    Convention: all times are on the recording's own clock, so a label's time equals its frame's.
    The frames are those in the distorted view, pixel for pixel that of the event sensor.

    Args:
        name: the sequence's name.
        folder: the folder that is named where something is wrong.
        height: rows of the sensor and of the frames.
        width: columns of the sensor and of the frames.
        frame_times_us: middle of each frame's exposure, int64, rising, shape (frames,).
        events_path: the file of the recorded events, in the layout of DSEC.
        frame_paths: the frames' files in order; empty where the recording has no frames.
        exposures_us: start and end of each frame's exposure, int64, shape (frames, 2), if known.
        tracks: labelled boxes sorted by time, with at least the fields t, x, y, w, h and class_id;
            None where the recording has no labels.
        label_paths: the files that the labels were read from.
        without_frames: why there are no frames, and what to do about it.
    """

    name: str
    folder: Path
    height: int
    width: int
    frame_times_us: NDArray[np.int64]
    events_path: Path
    frame_paths: tuple[Path, ...] = ()
    exposures_us: NDArray[np.int64] | None = None
    tracks: NDArray[np.void] | None = None
    label_paths: tuple[Path, ...] = ()
    without_frames: str = "got none; set data.root to recordings with frames, or sim=real"

    @classmethod
    def load(
        cls, folder: Path | str, height: int | None = None, width: int | None = None
    ) -> Recording:
        """Read a sequence in a folder of its own, see `at`.

        Raises:
            FileNotFoundError: the folder does not exist.
            ValueError: as `at` says.
        """
        folder = Path(folder)
        if not folder.is_dir():
            raise FileNotFoundError(f"Expected a recording at {folder}, found none; set data.root")
        return cls.at(Places.inside(folder), height, width)

    @classmethod
    def at(cls, places: Places, height: int | None = None, width: int | None = None) -> Recording:
        """Read a sequence; without a given size the first frame tells the sensor's.

        Raises:
            ValueError: there are neither events nor frames, frames and timestamps do not fit, there
                is only one frame, the frames have another size than given, the size is unknown, or
                the labels cannot be read.
        """
        folder, paths = places.folder, frames_in(places.frames)
        if not paths and not places.events.exists():
            raise ValueError(
                f"Expected {EVENTS} or images in {FRAMES} in {folder}, found neither; "
                "set data.root to a folder of recordings in the layout of DSEC"
            )
        times_us = frame_times(places.frame_times, len(paths))
        if paths:
            height, width = frame_size(paths[0], height, width)
        if height is None or width is None:
            raise ValueError(
                f"Expected a sensor size for {folder}, which has no frames to tell it; "
                "set data.size"
            )
        labels = places.tracks
        found = cls(
            name=places.name,
            folder=folder,
            height=height,
            width=width,
            frame_times_us=times_us,
            events_path=places.events,
            frame_paths=paths,
            exposures_us=_exposures(places.exposures, len(times_us)),
            tracks=_tracks(labels, times_us) if labels.exists() else None,
            label_paths=(labels,) if labels.exists() else (),
        )
        rectified = not paths and bool(frames_in(places.rectified))
        return replace(found, without_frames=_rectified_alone(places)) if rectified else found

    def first_frames(self, count: int) -> Recording:
        """The recording up to and with its frame `count`, as a recording of its own name.

        Raises:
            ValueError: fewer than two frames are asked for.
        """
        if count < 2:
            raise ValueError(
                f"Expected at least two frames of {self.name}, got {count}; set data.first_frames"
            )
        if len(self.frame_times_us) <= count:
            return self
        tracks = self.tracks
        if tracks is not None:
            tracks = tracks[tracks["t"] <= self.frame_times_us[count - 1]]
        exposures = None if self.exposures_us is None else self.exposures_us[:count]
        return replace(
            self,
            name=f"{self.name}_first{count}",
            frame_times_us=self.frame_times_us[:count],
            frame_paths=self.frame_paths[:count],
            exposures_us=exposures,
            tracks=tracks,
        )

    @property
    def has_frames(self) -> bool:
        """Whether there are frames to simulate from."""
        return len(self.frame_paths) > 0

    def frames(self) -> FrameFolder:
        """The frames with their times, a few at a time.

        Raises:
            ValueError: there are none.
        """
        if not self.has_frames:
            raise ValueError(
                f"Expected frames of {self.name} to simulate from, {self.without_frames}"
            )
        return FrameFolder(self.frame_paths, self.frame_times_us)

    def frames_hash(self) -> str:
        """What a simulator is fed with: the content of the frames, and their times."""
        return short_hash([self.frame_times_us.tolist(), content_hashes(self.frame_paths)])

    def content_hash(self) -> str:
        """Everything that a training, a score or a test takes from this recording, by content."""
        events = content_hash(self.events_path) if self.events_path.is_file() else None
        labels: list[str | None] = [*content_hashes(self.label_paths)] or [None]
        return short_hash([self.name, self.frames_hash(), events, *labels])

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


def frames_in(place: Path) -> tuple[Path, ...]:
    """The frames of a folder in their order; none where it has none, or does not exist.

    Raises:
        ValueError: their names admit two orders.
    """
    if not place.is_dir() or not any(p.suffix.lower() in IMAGE_SUFFIXES for p in place.iterdir()):
        return ()
    return tuple(image_paths(place))


def _rectified_alone(places: Places) -> str:
    if not places.calibration.exists():
        return (
            f"got only rectified ones in {places.rectified} and no {CALIBRATION} to remap them by; "
            "unpack that, or DSEC-Detection's distorted images"
        )
    return (
        f"got only rectified ones in {places.rectified}; type eqs prepare data=dsec "
        "data.root=PATH, which remaps them into the view of the event camera, or unpack "
        "DSEC-Detection's distorted images"
    )


def frame_times(path: Path, frames: int) -> NDArray[np.int64]:
    """The times in a file, int64 microseconds; none without a file and without frames.

    Raises:
        ValueError: the file is missing, does not fit so many frames, or its times do not rise.
    """
    if not path.exists():
        if frames:
            raise ValueError(
                f"Expected the times of {frames} frames at {path}, found none; add the time of "
                "each frame in microseconds, one a line"
            )
        return np.empty(0, np.int64)
    times_us = whole_numbers(path).reshape(-1)
    if frames == 1 or len(times_us) == 1:
        raise ValueError(
            f"Expected at least two frames and times in {path}, got one; a single frame moves "
            "nothing"
        )
    if frames and len(times_us) != frames:
        raise ValueError(
            f"Expected one timestamp per frame, got {len(times_us)} lines in {path} and {frames} "
            "frames; complete the recording"
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


def _exposures(path: Path, frames: int) -> NDArray[np.int64] | None:
    if not path.exists():
        return None
    exposures_us = whole_numbers(path)
    if exposures_us.shape != (frames, 2):
        raise ValueError(
            f"Expected start and end of {frames} exposures in {path}, got numbers of shape "
            f"{exposures_us.shape}; complete the file or remove it"
        )
    return exposures_us


def frame_size(path: Path, height: int | None, width: int | None) -> tuple[int, int]:
    """Height and width of a frame.

    Raises:
        ValueError: it is no image, or of another size than given.
    """
    found_height, found_width = image_size(path)
    if (height or found_height, width or found_width) != (found_height, found_width):
        raise ValueError(
            f"Expected frames of {width}x{height} pixels, got {found_width}x{found_height} in "
            f"{path}; set data.size"
        )
    return found_height, found_width


def _tracks(path: Path, frame_times_us: NDArray[np.int64]) -> NDArray[np.void]:
    tracks = label_array(path)
    if len(tracks) and not len(frame_times_us):
        raise ValueError(
            f"Expected the times of the frames of the labels in {path}, found none; add "
            f"{FRAME_TIMES}, the time of each labelled frame in microseconds, one a line"
        )
    return tracks[np.argsort(tracks["t"], kind="stable")]
