"""Recordings without labels: enough to score simulators on, too little to train."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from eqs.data.converted import converted
from eqs.data.dataset import Dataset
from eqs.data.places import EVENTS, FRAMES, Places, find_recordings
from eqs.data.recording import Recording, frames_in
from eqs.events.hints import NOTHING_SAID, Hints

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class RecordingFolder(Dataset):
    """Recordings without labels: enough to score simulators, too little to train.

    The size of each sensor is that of its frames. Recordings without frames cannot be simulated
    and are left out; `skipped` names them. Beside the layouts of DSEC, a folder with one event file
    of any kind will do, see `find_recordings`.

    Args:
        name: name of the data set, used for the folders of what is derived from it.
        root: folder whose subfolders are recordings.
        converted: folder for events that are not in the layout of DSEC.
        hints: what event files do not say of themselves.
        crop_rows: number of rows, counted from the top, that are used; all of them if None.
    """

    name: str
    root: Path | str
    converted: Path | str
    hints: Hints = NOTHING_SAID
    crop_rows: int | None = None

    @property
    def split_names(self) -> Sequence[str]:
        """Test data only."""
        return ("test",)

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
            for name, places in find_recordings(Path(self.root)).items()
            if (reason := _reason_to_skip(places))
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
        found, skipped = find_recordings(Path(self.root)), self.skipped
        if len(skipped) == len(found):
            reasons = "; ".join(f"{name} {reason}" for name, reason in skipped.items())
            raise ValueError(
                f"Expected recordings with frames and events in {self.root}, got none ({reasons}); "
                "set data.root"
            )
        return [self.load(places) for name, places in found.items() if name not in skipped]

    def sequences(self) -> dict[str, list[Places]]:
        """Where all recordings lie, those that are left out among them."""
        return {"test": list(find_recordings(Path(self.root)).values())}

    def load(self, sequence: Places) -> Recording:
        """The recording of a sequence, of its own size."""
        found = Recording.at(sequence)
        if not found.events_path.exists():
            return found
        size = found.height, found.width
        events = converted(found.events_path, self.converted, *size, self.hints)
        return replace(found, events_path=events)


def _reason_to_skip(places: Places) -> str | None:
    if not frames_in(places.frames):
        return f"has no frames in {FRAMES}"
    return None if places.events.exists() else f"has no events in {EVENTS}"
