"""Where the events of a recording come from: its own file, or a simulator fed with its frames."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from rich.progress import track

from eqs.content import content_hash
from eqs.data.recording import Recording
from eqs.events.writer import EventWriter
from eqs.files import one_at_a_time, read_json, short_hash, write_json
from eqs.frames import WHITE, LightOfScenes
from eqs.processors import available_cores, side_by_side
from eqs.simulators import Simulator


class EventSource(Protocol):
    """Gives the event file of a recording."""

    @property
    def name(self) -> str:
        """The simulator's name, or `real`."""

    @property
    def label(self) -> str:
        """Name of this very stream: differs whenever the events could differ."""

    @property
    def caveat(self) -> str:
        """Why it is no stream of a simulator like others; empty where it is one."""

    @property
    def setting(self) -> str:
        """What its simulator sees of frames, in words; empty where there is nothing to say."""

    def prepare(self, recordings: Sequence[Recording]) -> None:
        """Make every file that `path` will name."""

    def path(self, recording: Recording) -> Path:
        """The DSEC HDF5 file with the recording's events."""


@dataclass(frozen=True)
class RecordedEvents:
    """The events that the sensor itself recorded."""

    name: str = "real"
    label: str = "real"
    caveat: str = ""
    setting: str = ""

    def prepare(self, recordings: Sequence[Recording]) -> None:
        """Nothing to make: the files came with the recordings."""

    def path(self, recording: Recording) -> Path:
        """The recording's own event file."""
        return recording.events_path


@dataclass(frozen=True)
class SimulatedEvents:
    """Events simulated from a recording's frames, written once and reused.

    A stream is reused only while the simulator's parameters and version, what the frames hold,
    their times and the file itself are the same. Other parameters make a stream in a folder of its
    own; other frames replace it.

    Args:
        simulator: the simulator with its parameters.
        root: folder for simulated streams of one data set.
        workers: processes that simulate side by side.
    """

    simulator: Simulator
    root: Path
    workers: int = field(default_factory=available_cores)

    @property
    def name(self) -> str:
        """The simulator's name."""
        return self.simulator.name

    @property
    def setting(self) -> str:
        """What its simulator sees of frames, in words."""
        return self.simulator.setting

    @property
    def label(self) -> str:
        """Name and parameter hash, unique for what would be simulated."""
        identity = [self.simulator.parameters(), self.simulator.version]
        return f"{self.simulator.name}-{short_hash(identity)}"

    @property
    def caveat(self) -> str:
        """What speaks against its simulator on this data set, whose name its folder has."""
        return self.simulator.caveat(self.root.name)

    def path(self, recording: Recording) -> Path:
        """Where the recording's simulated events lie, in DSEC layout."""
        return self._folder(recording) / "events" / "left" / "events.h5"

    def prepare(self, recordings: Sequence[Recording]) -> None:
        """Simulate the recordings that are missing or whose frames changed.

        Raises:
            ValueError: a recording has no frames.
        """
        blind = [recording for recording in recordings if not recording.has_frames]
        if blind:
            raise ValueError(
                f"Expected frames of {blind[0].name} to simulate from, {blind[0].without_frames}"
            )
        if not self._missing(recordings):
            return
        description = f"simulating {self.simulator.name}"
        with one_at_a_time(self.root / self.label, description):
            missing = self._missing(recordings)
            if not missing:  # another process was at it
                return
            done = side_by_side(self.simulate, missing, min(self.workers, len(missing)))
            for _ in track(done, description=description, total=len(missing)):
                pass

    def simulate(self, recording: Recording) -> None:
        """Write one recording's events and the manifest that says what they are."""
        path = self.path(recording)
        light, clip = self.simulator.light, recording.frames()
        if isinstance(light, LightOfScenes):
            clip = light.clip(recording.folder, recording.frame_times_us)
        _, events = write_stream(self.simulator, recording.name, clip, path)
        write_json(
            self._manifest_path(recording),
            {
                "simulator": self.simulator.name,
                "parameters": self.simulator.parameters(),
                "version": self.simulator.version,
                "recording": recording.name,
                "frames": recording.frames_hash(),
                "file": content_hash(path),
                "events": events,
            },
        )

    def _folder(self, recording: Recording) -> Path:
        return self.root / self.label / recording.name

    def _manifest_path(self, recording: Recording) -> Path:
        return self._folder(recording) / "manifest.json"

    def _missing(self, recordings: Sequence[Recording]) -> list[Recording]:
        return [recording for recording in recordings if not self._is_current(recording)]

    def _is_current(self, recording: Recording) -> bool:
        manifest = self._manifest_path(recording)
        if not manifest.exists() or not self.path(recording).exists():
            return False
        expected = {
            "parameters": self.simulator.parameters(),
            "version": self.simulator.version,
            "frames": recording.frames_hash(),
            "file": content_hash(self.path(recording)),
        }
        return expected.items() <= read_json(manifest).items()


def write_stream(
    simulator: Simulator,
    name: str,
    clip: Iterable[tuple[NDArray[Any], NDArray[np.int64]]],
    path: Path,
    follow: Callable[[int, int], None] = lambda frames, events: None,
) -> tuple[int, int]:
    """Write the events of a clip, chunk by chunk, in memory that does not grow with its length.

    Args:
        simulator: what makes events from frames.
        name: names the stream to the simulator, whose randomness depends on it.
        clip: chunks of frames with their times in microseconds.
        path: DSEC event file to write, whose times count from the first frame.
        follow: told the numbers of frames and events after each chunk.

    Returns:
        Numbers of frames and events.

    Raises:
        ValueError: the clip has no frame.
    """
    chunks = iter(clip)
    first = next(chunks, None)
    if first is None:
        raise ValueError(f"Expected frames to simulate {path} from, got none; give a longer clip")
    stream = simulator.start(name, WHITE)  # which clips on disk are scaled to
    height, width = first[0].shape[1:3]
    path.parent.mkdir(parents=True, exist_ok=True)
    frames = count = 0
    with EventWriter(path, height, width, t_offset_us=int(first[1][0])) as writer:
        for images, times_us in itertools.chain([first], chunks):
            events = stream.step(images, times_us)
            writer.append(events)
            frames, count = frames + len(images), count + len(events)
            follow(frames, count)
        rest = stream.finish()
        writer.append(rest)
        writer.span_us = stream.span_us
    return frames, count + len(rest)
