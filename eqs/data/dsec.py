"""DSEC, and every other labelled data set in its layout."""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Protocol

from eqs.data.dataset import Dataset
from eqs.data.event_view import EventView
from eqs.data.places import Places, find_sequences
from eqs.data.recording import Recording, frames_in

log = logging.getLogger(__name__)
SCORED = "scored"


class Generator(Protocol):
    """Makes a data set that does not exist yet."""

    @property
    def sensor_hash(self) -> str:
        """What identifies the event camera that is looked at."""

    def generate(self, root: Path) -> None:
        """Make what is missing below `root`; nothing where all is there."""

    def events_file(self, root: Path, name: str) -> Path | None:
        """Where another sensor's events of a recording lie; None where they lie with the frames."""

    def record(self, root: Path, names: Collection[str]) -> None:
        """Make another sensor's events of these recordings, where they are missing."""

    def events_said(self, root: Path) -> str:
        """How many events there are, in a sentence."""


@dataclass(frozen=True, kw_only=True)
class DSECFolder(Dataset):
    """A labelled data set: sequences below one root, dealt to splits by their names.

    Sequences may lie below the root in any of DSEC's three layouts, see `eqs.data.places`; which
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
        scored: patterns of the sequences that simulators are scored on; the test split if None.
        first_frames: how many frames of each scored sequence count; all of them if None.
        event_view: where the frames that are rectified go as the event camera would see them.

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
    scored: Sequence[str] | None = None
    first_frames: int | None = None
    event_view: EventView | None = None

    def __post_init__(self) -> None:
        """Check the size before anything is generated with it."""
        rows, _ = parse_size(self.size)
        if self.crop_rows is not None and not 0 < self.crop_rows <= rows:
            raise ValueError(
                f"Expected data.crop_rows between 1 and {rows}, got {self.crop_rows}; "
                "null uses all rows"
            )

    @property
    def split_names(self) -> Sequence[str]:
        """The splits that `splits` names."""
        return tuple(self.splits)

    @property
    def sensor_hash(self) -> str | None:
        """What identifies the rendered camera, where the data set is generated."""
        return None if self.generator is None else self.generator.sensor_hash

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
        found = self._found()
        for split, patterns in self._named().items():
            missing = [p for p in patterns if not any(fnmatchcase(name, p) for name in found)]
            if missing:
                log.warning(
                    "%s has no sequence %s of the %s split", root, ", ".join(missing), split
                )

    def make_frames(self) -> None:
        """Bring rectified frames of all splits into the event camera's view, where none are."""
        if self.event_view is not None:
            chosen = {each.name: each for split in self._named() for each in self._chosen(split)}
            self.event_view.prepare(list(chosen.values()))

    def make_events(self, recordings: Sequence[Recording]) -> None:
        """Make another sensor's events of these recordings, where one is chosen and they lack."""
        if self.generator is not None:
            self.generator.record(Path(self.root), {each.folder.name for each in recordings})

    def events_said(self) -> str:
        """How many events the rendered camera sees, in a sentence."""
        return "" if self.generator is None else self.generator.events_said(Path(self.root))

    def sequences(self) -> dict[str, list[Places]]:
        """Where the sequences of each split lie, which may be none."""
        return {split: self._chosen(split) for split in self.splits}

    def recordings(self, split: str) -> list[Recording]:
        """The recordings of one split, by name.

        Raises:
            ValueError: there is no such split, or no sequence belongs to it.
        """
        if split not in self._named():
            raise ValueError(
                f"Expected one of the splits {', '.join(self.splits)}, got {split!r}; "
                "set data.splits"
            )
        chosen = self._chosen(split)
        if not chosen:
            found = ", ".join(self._found())
            raise ValueError(
                f"Expected sequences named {', '.join(self._named()[split])} for the {split} split "
                f"in {self.root}, got {found}; set data.root or data.splits"
            )
        return [self.load(places) for places in chosen]

    def load(self, sequence: Places) -> Recording:
        """The recording of a sequence, of the sensor's size, with the chosen sensor's events."""
        places = self._viewed(sequence)
        if self.generator is not None:
            events = self.generator.events_file(Path(self.root), sequence.name)
            places = places if events is None else replace(places, events=events)
        return Recording.at(places, *parse_size(self.size))

    def scored_recordings(self) -> list[Recording]:
        """The recordings that simulators are scored on."""
        found = self.recordings(SCORED if self.scored is not None else "test")
        count = self.first_frames
        return found if count is None else [each.first_frames(count) for each in found]

    def _found(self) -> dict[str, Places]:
        root = Path(self.root)
        if self.generator is not None and not root.is_dir():
            raise FileNotFoundError(
                f"Expected {self.name} at {root}, which is rendered on first use; type python "
                "scripts/prepare.py first, or set data.root"
            )
        return find_sequences(root)

    def _named(self) -> dict[str, Sequence[str]]:
        """Patterns of every group of sequences."""
        scored = {} if self.scored is None else {SCORED: self.scored}
        return {**self.splits, **scored}

    def _chosen(self, group: str) -> list[Places]:
        found = self._found()
        patterns = self._named()[group]
        return [found[name] for name in found if any(fnmatchcase(name, p) for p in patterns)]

    def _viewed(self, places: Places) -> Places:
        """The places of a sequence, with remapped frames where it came without."""
        if self.event_view is None or frames_in(places.frames):
            return places
        return self.event_view.places(places)


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
