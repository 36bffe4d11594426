"""A data set of one's own camera, described by where its files lie."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.progress import track

from eqs.data.converted import converted
from eqs.data.dataset import Dataset
from eqs.data.dsec import parse_size
from eqs.data.label_files import LabelFiles, LabelledFrames
from eqs.data.recording import Recording, frame_size, frame_times, frames_in
from eqs.events.hints import NOTHING_SAID, Hints
from eqs.frames.order import natural_key

NAME = "{name}"


@dataclass(frozen=True, kw_only=True)
class OwnSequence:
    """A recording before it is read: its name, and the file of its events."""

    name: str
    events: Path


@dataclass(frozen=True, kw_only=True)
class OwnDataset(Dataset):
    """Recordings of any camera, with labels of any kind that is read, see `label_files`.

    Every place is a path below the root with `{name}` for the recording's name; the recordings are
    those that have events.

    Args:
        name: name of the data set, used for the folders of what is derived from it.
        root: where the recordings lie.
        size: width and height of the sensor, as in 346x260.
        splits: shell-style patterns of the recordings' names in each split.
        events: file of the events, of any kind that is read.
        converted: folder for events that are not in the layout of DSEC.
        hints: what event files do not say of themselves.
        frames: folder of the frames, pixel for pixel those of the sensor; None without frames.
        frame_times: text file of the frames' times, microseconds, one a line; None without frames,
            where detectors are asked at the times of the labels.
        labels: the labels; None where there are none.
        classes: the numbers that the labels give each class.
        crop_rows: number of rows, counted from the top, that are used; all of them if None.
        exhaustive_labels: whether a frame without a label is known to show no object.

    Raises:
        ValueError: the size cannot be read, or a place does not depend on the name.
    """

    name: str
    root: Path | str
    size: str
    splits: Mapping[str, Sequence[str]]
    events: str
    converted: Path | str
    hints: Hints = NOTHING_SAID
    frames: str | None = None
    frame_times: str | None = None
    labels: LabelFiles | None = None
    classes: Mapping[str, Sequence[int]] | None = None
    crop_rows: int | None = None
    exhaustive_labels: bool = False

    def __post_init__(self) -> None:
        """Check the size and the places."""
        parse_size(self.size)
        places = {"events": self.events, "frames": self.frames, "frame_times": self.frame_times}
        for key, place in places.items():
            if place is not None and NAME not in place:
                raise ValueError(
                    f"Expected a place with {NAME} for the recording's name, got {place!r}; set "
                    f"data.{key}"
                )
        if (self.frames is None) != (self.frame_times is None):
            raise ValueError(
                f"Expected frames and their times or neither, got {self.frames!r} and "
                f"{self.frame_times!r}; set data.frames and data.frame_times"
            )

    @property
    def split_names(self) -> Sequence[str]:
        """The splits that `splits` names."""
        return tuple(self.splits)

    def prepare(self) -> None:
        """Bring events of other kinds into the layout of DSEC.

        Raises:
            FileNotFoundError: there is no such folder.
            ValueError: there is no recording, or its events cannot be read.
        """
        size = parse_size(self.size)
        for each in track(self._found(), description="reading events", transient=True):
            converted(each.events, self.converted, *size, self.hints)

    def sequences(self) -> dict[str, list[OwnSequence]]:
        """The recordings of each split, which may be none."""
        found = self._found()
        return {
            split: [each for each in found if any(fnmatchcase(each.name, p) for p in patterns)]
            for split, patterns in self.splits.items()
        }

    def recordings(self, split: str) -> list[Recording]:
        """The recordings of one split, by name.

        Raises:
            ValueError: there is no such split, or no recording belongs to it.
        """
        if split not in self.splits:
            raise ValueError(
                f"Expected one of the splits {', '.join(self.splits)}, got {split!r}; "
                "set data.splits"
            )
        chosen = self.sequences()[split]
        if not chosen:
            names = ", ".join(each.name for each in self._found())
            raise ValueError(
                f"Expected recordings named {', '.join(self.splits[split])} for the {split} split "
                f"in {self.root}, got {names}; set data.root or data.splits"
            )
        return [self.load(each) for each in chosen]

    def load(self, sequence: OwnSequence) -> Recording:
        """Read one recording.

        Raises:
            FileNotFoundError: a file is missing.
            ValueError: frames, times and labels do not fit, or one of them cannot be read.
        """
        name, (height, width) = sequence.name, parse_size(self.size)
        paths: tuple[Path, ...] = ()
        times_us = np.empty(0, np.int64)
        if self.frames is not None and self.frame_times is not None:
            paths = self._frames(name)
            frame_size(paths[0], height, width)
            times_us = frame_times(self._existing(self.frame_times, name), len(paths))
        tracks, label_paths = self._labels(name, paths, times_us)
        if tracks is not None and not paths:
            times_us = np.unique(tracks["t"].astype(np.int64))
        return Recording(
            name=name,
            folder=sequence.events.parent,
            height=height,
            width=width,
            frame_times_us=times_us,
            events_path=converted(sequence.events, self.converted, height, width, self.hints),
            frame_paths=paths,
            tracks=tracks,
            label_paths=label_paths,
        )

    def _frames(self, name: str) -> tuple[Path, ...]:
        folder = Path(self.root) / str(self.frames).format(name=name)
        paths = frames_in(folder)
        if not paths:
            raise FileNotFoundError(f"Expected frames in {folder}, found none; set data.frames")
        return paths

    def _labels(
        self, name: str, paths: Sequence[Path], times_us: NDArray[np.int64]
    ) -> tuple[NDArray[np.void] | None, tuple[Path, ...]]:
        if self.labels is None:
            return None, ()
        height, width = parse_size(self.size)
        files = self.labels.paths(Path(self.root), name)
        for path in files:
            if not path.is_file():
                raise FileNotFoundError(f"Expected labels at {path}, found none; set data.labels")
        frames = LabelledFrames(
            name=name,
            stems=[path.stem for path in paths],
            times_us=times_us,
            height=height,
            width=width,
        )
        tracks = self.labels.read(files, frames)
        return tracks[np.argsort(tracks["t"], kind="stable")], files

    def _existing(self, place: str, name: str) -> Path:
        path = Path(self.root) / place.format(name=name)
        if not path.is_file():
            raise FileNotFoundError(
                f"Expected the times of the frames at {path}, found none; set data.frame_times"
            )
        return path

    def _found(self) -> list[OwnSequence]:
        root = Path(self.root)
        if not root.is_dir():
            raise FileNotFoundError(
                f"Expected a data set at {root}, found no such folder; set data.root"
            )
        first, *others = (re.escape(part) for part in self.events.split(NAME))
        pattern = re.compile(rf"{first}(?P<name>[^/]+){'(?P=name)'.join(others)}")
        names: dict[str, Path] = {}
        for path in root.glob(self.events.replace(NAME, "*")):
            match = pattern.fullmatch(path.relative_to(root).as_posix())
            if match is not None:
                names[match["name"]] = path
        if not names:
            raise ValueError(
                f"Expected events at {root / self.events}, found none; set data.root or data.events"
            )
        ordered = sorted(names, key=lambda name: (natural_key(name), name))
        return [OwnSequence(name=name, events=names[name]) for name in ordered]
