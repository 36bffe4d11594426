"""Streams that another program simulated: one event file per recording, of any kind."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from rich.progress import track

from eqs.content import content_hash, content_hashes
from eqs.data.converted import read
from eqs.data.places import EVENTS
from eqs.data.recording import Recording
from eqs.events.hints import NOTHING_SAID, Hints
from eqs.files import one_at_a_time, read_json, short_hash, write_json

log = logging.getLogger(__name__)
COVERED = 0.9  # share of the frames' time that events should cover


@dataclass(frozen=True, kw_only=True)
class GivenEvents:
    """Where the streams lie, and what the tables call them.

    Args:
        folder: holds `<recording>.<any ending>` or `<recording>/events/left/events.h5`.
        name: name of the simulator.
        from_first_frame: whether times count from each recording's first frame, and not on its
            clock.
        hints: what the files do not say of themselves.

    Raises:
        ValueError: the name is taken, or none.
    """

    folder: Path | str
    name: str
    from_first_frame: bool = False
    hints: Hints = NOTHING_SAID

    def __post_init__(self) -> None:
        """Check the name."""
        if not str(self.name).isidentifier() or self.name == "real":
            raise ValueError(
                f"Expected a name of letters, digits and _ other than real, got {self.name!r}; "
                "set sim.name"
            )

    def file(self, recording: Recording) -> Path:
        """The recording's file.

        Raises:
            FileNotFoundError: there is none.
            ValueError: there are several.
        """
        folder = Path(self.folder)
        nested = folder / recording.name / EVENTS
        found = [nested] if nested.is_file() else []
        if folder.is_dir():
            files = [path for path in folder.iterdir() if path.is_file()]
            found += [path for path in files if path.stem == recording.name]
        if not found:
            raise FileNotFoundError(
                f"Expected {recording.name} with any ending in {folder}, found none; set "
                "sim.folder to a folder with a file named as each recording"
            )
        if len(found) > 1:
            raise ValueError(
                f"Expected one file of {recording.name} in {folder}, got "
                f"{', '.join(sorted(path.name for path in found))}; keep one"
            )
        return found[0]


@dataclass(frozen=True)
class GivenStreams:
    """An event source of given streams, each brought into the layout of DSEC once.

    Convention: a stream that does not say when its camera was watching is taken to have watched
    its recording's frames, from the first to the last, as a simulator does.

    Args:
        given: where the streams lie.
        root: folder for the streams of one data set.
    """

    given: GivenEvents
    root: Path

    @property
    def name(self) -> str:
        """The simulator's name, marked as one that did not run here."""
        return f"{self.given.name} (given)"

    @property
    def caveat(self) -> str:
        """None is known of a program that did not run here."""
        return ""

    @property
    def setting(self) -> str:
        """Nor what it saw."""
        return ""

    @cached_property
    def label(self) -> str:
        """Name and a hash of what the files hold, hidden ones left out."""
        folder = Path(self.given.folder)
        files = [path.relative_to(folder) for path in sorted(folder.rglob("*")) if path.is_file()]
        files = [path for path in files if not any(part.startswith(".") for part in path.parts)]
        names = [path.as_posix() for path in files]
        content = content_hashes(folder / path for path in files)
        read_as = [self.given.from_first_frame, self.given.hints.record()]
        return f"{self.given.name}-{short_hash(['given', names, content, read_as])}"

    def path(self, recording: Recording) -> Path:
        """Where the recording's events lie, in DSEC layout."""
        return self.root / self.label / recording.name / EVENTS

    def prepare(self, recordings: Sequence[Recording]) -> None:
        """Convert the streams that are not converted yet.

        Raises:
            FileNotFoundError: a recording has no file.
            ValueError: a file cannot be read, is of another sensor, or runs on another clock.
        """
        for recording in recordings:
            self.given.file(recording)
        place = self.root / self.label
        with one_at_a_time(place, f"converting {self.name}"):
            missing = [each for each in recordings if not self._is_current(each)]
            for recording in track(missing, f"converting {self.name}", disable=not missing):
                self._convert(recording)

    def _record(self, recording: Recording) -> Path:
        return self.root / self.label / recording.name / "manifest.json"

    def _is_current(self, recording: Recording) -> bool:
        record, path = self._record(recording), self.path(recording)
        if not (record.is_file() and path.is_file()):
            return False
        return self._sources(recording).items() <= read_json(record).items()

    def _sources(self, recording: Recording) -> dict[str, str]:
        times = short_hash(recording.frame_times_us.tolist())
        return {"source": content_hash(self.given.file(recording)), "times": times}

    def _convert(self, recording: Recording) -> None:
        source = self.given.file(recording)
        events = read(source, recording.height, recording.width, self.given.hints)
        first, last = (int(time) for time in recording.frame_times_us[[0, -1]])
        if self.given.from_first_frame:
            events = events.shifted(first)
        extent = events.extent_us
        if extent is None:
            raise ValueError(
                f"Expected events in {source}, got none, nor a span; simulate it again"
            )
        shared = max(0, min(last, extent[1]) - max(first, extent[0])) / max(1, last - first)
        if not shared:
            raise ValueError(
                f"Expected events on the clock of the frames, {first} to {last} us, in {source}, "
                f"got {extent[0]} to {extent[1]} us; shift them or, where they count from the "
                "first frame, set sim.from_first_frame=true"
            )
        if shared < COVERED:
            log.warning("%s covers %.0f %% of its frames' time", source, 100 * shared)
        if events.span_us is None:
            inside = events.window(first, last + 1)
            events = replace(inside, span_us=(first, last))
        events.save(self.path(recording))
        write_json(self._record(recording), {**self._sources(recording), "events": len(events)})
