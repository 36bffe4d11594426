"""Data sets of recordings in the layout of DSEC, with or without labels."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Protocol

from eqs.data.recording import EVENTS, FRAMES, Recording, frames_in
from eqs.frames import by_name

log = logging.getLogger(__name__)
SPLIT_FOLDERS = ("train", "val", "test")


class Generator(Protocol):
    """Makes a data set that does not exist yet."""

    @property
    def sensor_hash(self) -> str:
        """What identifies the event camera that the data set is made with."""

    def generate(self, root: Path) -> None:
        """Make what is missing below `root`; nothing where all is there."""


@dataclass(frozen=True, kw_only=True)
class DSECFolder:
    """A labelled data set: sequences below one root, dealt to splits by their names.

    Sequences may lie in `root/train`, `root/val` and `root/test` or directly in `root`; which
    split they belong to is said by `splits` alone, since DSEC keeps its validation sequences among
    the training ones.

    Args:
        name: name of the data set, used for the folders of what is derived from it.
        root: where the sequences lie.
        size: width and height of the sensor, as in 640x480.
        splits: shell-style patterns of the sequence names of each split.
        generator: what makes the data set on first use, if it can be made.
        crop_rows: number of rows, counted from the top, that are used; all of them if None.
        exhaustive_labels: whether a frame without a label is known to show no object.

    Raises:
        ValueError: the size cannot be read or the crop does not fit it.
    """

    name: str
    root: Path | str
    size: str
    splits: Mapping[str, Sequence[str]]
    generator: Generator | None = None
    crop_rows: int | None = None
    exhaustive_labels: bool = False

    def __post_init__(self) -> None:
        """Check the size before anything is generated with it."""
        rows, _ = parse_size(self.size)
        if self.crop_rows is not None and not 0 < self.crop_rows <= rows:
            raise ValueError(
                f"Expected data.crop_rows between 1 and {rows}, got {self.crop_rows}; "
                "null uses all rows"
            )

    @property
    def height(self) -> int:
        """Rows that are used."""
        return self.crop_rows or parse_size(self.size)[0]

    @property
    def width(self) -> int:
        """Columns of the sensor."""
        return parse_size(self.size)[1]

    def prepare(self) -> None:
        """Generate what is missing, or check that the data set is there.

        Raises:
            FileNotFoundError: there is no such folder and nothing to generate it.
            ValueError: the folder holds no sequences.
        """
        root = Path(self.root)
        if self.generator is not None:
            self.generator.generate(root)
        found = _existing_sequences(root)
        for split, patterns in self.splits.items():
            for pattern in patterns:
                if not any(fnmatchcase(name, pattern) for name in found):
                    log.warning("%s has no sequence %s of the %s split", root, pattern, split)

    def folders(self) -> dict[str, list[Path]]:
        """The folders of the sequences of each split, which may be none."""
        found = _existing_sequences(Path(self.root))
        return {
            split: [path for name, path in found.items() if any(fnmatchcase(name, p) for p in each)]
            for split, each in self.splits.items()
        }

    def recordings(self, split: str) -> list[Recording]:
        """The recordings of one split, by name.

        Raises:
            ValueError: there is no such split, or no sequence belongs to it.
        """
        if split not in self.splits:
            raise ValueError(
                f"Expected one of the splits {', '.join(self.splits)}, got {split!r}; "
                "set data.splits"
            )
        chosen = self.folders()[split]
        if not chosen:
            found = ", ".join(_existing_sequences(Path(self.root)))
            raise ValueError(
                f"Expected sequences named {', '.join(self.splits[split])} for the {split} split "
                f"in {self.root}, got {found}; set data.root or data.splits"
            )
        return [self.load(folder) for folder in chosen]

    def load(self, folder: Path) -> Recording:
        """The recording in a folder, of the sensor's size."""
        return Recording.load(folder, *parse_size(self.size))

    def all_recordings(self) -> list[Recording]:
        """The recordings of every split."""
        return [recording for split in self.splits for recording in self.recordings(split)]


@dataclass(frozen=True, kw_only=True)
class RecordingFolder:
    """Recordings without labels: enough to score simulators, too little to train.

    The size of each sensor is that of its frames. Recordings without frames cannot be simulated
    and are left out; `skipped` names them.

    Args:
        name: name of the data set, used for the folders of what is derived from it.
        root: folder whose subfolders are recordings.
        crop_rows: number of rows, counted from the top, that are used; all of them if None.
    """

    name: str
    root: Path | str
    crop_rows: int | None = None

    def prepare(self) -> None:
        """Check that there is something to score, and say what is left out.

        Raises:
            FileNotFoundError: there is no such folder.
            ValueError: no recording below it has both frames and events.
        """
        self.recordings()
        for name, reason in self.skipped.items():
            log.warning("skipped %s: %s", name, reason)

    @property
    def skipped(self) -> dict[str, str]:
        """Name of each recording that is left out, and why."""
        return {
            name: reason
            for name, path in _existing_sequences(Path(self.root)).items()
            if (reason := _reason_to_skip(path))
        }

    def recordings(self, split: str = "test") -> list[Recording]:
        """All recordings with frames and events; they are test data only.

        Raises:
            ValueError: another split was asked for, or there is no such recording.
        """
        if split != "test":
            raise ValueError(
                f"Expected the test split of the unlabelled recordings in {self.root}, got "
                f"{split!r}; set data to a labelled data set to train"
            )
        found, skipped = _existing_sequences(Path(self.root)), self.skipped
        if len(skipped) == len(found):
            reasons = "; ".join(f"{name} {reason}" for name, reason in skipped.items())
            raise ValueError(
                f"Expected recordings with frames and events in {self.root}, got none ({reasons}); "
                "set data.root"
            )
        return [self.load(path) for name, path in found.items() if name not in skipped]

    def folders(self) -> dict[str, list[Path]]:
        """The folders of all recordings, those that are left out among them."""
        return {"test": list(_existing_sequences(Path(self.root)).values())}

    def load(self, folder: Path) -> Recording:
        """The recording in a folder, of its own size."""
        return Recording.load(folder)

    def all_recordings(self) -> list[Recording]:
        """All recordings with frames and events."""
        return self.recordings()


def parse_size(size: str) -> tuple[int, int]:
    """Height and width from text like 640x480 (width first, as sizes are spoken).

    Raises:
        ValueError: the text is not two positive numbers.

    Example:
        >>> parse_size("640x480")
        (480, 640)
    """
    parts = str(size).lower().split("x")
    if len(parts) != 2 or not all(part.isdecimal() and int(part) for part in parts):
        raise ValueError(f"Expected a size like 640x480, got {size!r}; set data.size")
    return int(parts[1]), int(parts[0])


def _existing_sequences(root: Path) -> dict[str, Path]:
    """Folder of each sequence below a root, by name."""
    if not root.is_dir():
        raise FileNotFoundError(
            f"Expected a data set at {root}, found no such folder; set data.root"
        )
    found: dict[str, Path] = {}
    for path in by_name(_sequence_folders(root)):
        if path.name in found:
            raise ValueError(
                f"Expected each sequence once below {root}, got {path.name} in "
                f"{found[path.name].parent} and {path.parent}; remove one"
            )
        found[path.name] = path
    if not found:
        raise ValueError(
            f"Expected sequences in the layout of DSEC below {root}, found none; set data.root to "
            "the folder that holds them, or that of train/ and test/"
        )
    return found


def _sequence_folders(root: Path) -> Iterator[Path]:
    for parent in (root, *(root / split for split in SPLIT_FOLDERS)):
        for path in parent.iterdir() if parent.is_dir() else ():
            complete = not path.name.endswith(".partial")
            if complete and ((path / "events").is_dir() or (path / "images").is_dir()):
                yield path


def _reason_to_skip(path: Path) -> str | None:
    if not frames_in(path):
        return f"has no frames in {FRAMES}"
    return None if (path / EVENTS).exists() else f"has no events in {EVENTS}"
