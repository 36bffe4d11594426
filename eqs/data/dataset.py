"""What every data set is: recordings, dealt to splits."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

from eqs.data.recording import Recording


class Dataset(ABC):
    """A data set of recordings; one of your own says at least its `name` and gives `recordings`.

    Attributes:
        name: names the folders of what is derived from it.
        crop_rows: number of rows, counted from the top, that are used; all of them if None.
        exhaustive_labels: whether a frame without a label is known to show no object.

    Example:
        >>> class Two(Dataset):
        ...     name = "two"
        ...     def recordings(self, split):
        ...         return []
        >>> Two().sequences()
        {'train': [], 'val': [], 'test': []}
    """

    name: str
    crop_rows: int | None = None
    exhaustive_labels: bool = False

    @property
    def split_names(self) -> Sequence[str]:
        """The splits that it has: training takes train and val, tests take test."""
        return ("train", "val", "test")

    @property
    def sensor_hash(self) -> str | None:
        """What identifies the event camera of a rendered data set; None where it is a real one."""
        return None

    @property
    def classes(self) -> Mapping[str, Sequence[int]] | None:
        """The numbers that labels give each class; None where nobody says so."""
        return None

    @abstractmethod
    def recordings(self, split: str) -> list[Recording]:
        """The recordings of one split.

        Raises:
            ValueError: there is no such split, or no recording belongs to it.
        """

    def prepare(self) -> None:  # noqa: B027 - there may be nothing to do
        """Generate what can be generated and is missing, or check that the data set is there."""

    def make_frames(self) -> None:  # noqa: B027
        """Make frames in the view of the event camera, where there are only others."""

    def make_events(self, recordings: Sequence[Recording]) -> None:  # noqa: B027
        """Make the real events of these recordings, where a rendered camera makes them on demand.

        Whoever reads real events asks for them first.
        """

    def events_said(self) -> str:
        """How many real events there are, in a sentence; empty where nobody counted them."""
        return ""

    def sequences(self) -> Mapping[str, Sequence[Any]]:
        """What `load` reads of each split, objects with a `name`; there may be none."""
        return {split: self.recordings(split) for split in self.split_names}

    def load(self, sequence: Any) -> Recording:  # noqa: ANN401 - whatever `sequences` gives
        """Read one of `sequences`.

        Raises:
            ValueError: something is wrong with it.
        """
        found: Recording = sequence
        return found

    def all_recordings(self) -> list[Recording]:
        """The recordings of every split."""
        return [recording for split in self.split_names for recording in self.recordings(split)]

    def scored_recordings(self) -> list[Recording]:
        """The recordings that simulators are scored on."""
        return self.recordings("test")
