"""One rendered recording of `dsec_mini`, in the layout of DSEC and DSEC-Detection."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from eqs.events.writer import EventWriter
from eqs.files import complete_folder, read_json, write_json
from eqs.scenes.camera import Exposure, FrameCamera
from eqs.scenes.first_order import FirstOrderSensor
from eqs.scenes.labels import LabelRule
from eqs.scenes.plan import Street
from eqs.scenes.sensor import ReferenceSensor
from eqs.scenes.sensor_stream import EventSensor
from eqs.scenes.world import DrivingWorld

VERSION: Final = 11  # raise it whenever the same parameters give other files
FRAME_PERIOD_US: Final = 50_000
LEAD_IN_US: Final = 60_000  # events before the first frame
LEAD_OUT_US: Final = 10_000  # and after the last one
SPLITS: Final = {"train": 0, "val": 1, "test": 2}
RECORD: Final = "sequence.json"
EVENTS: Final = Path("events/left/events.h5")
TRACKS: Final = Path("object_detections/left/tracks.npy")
TIMES: Final = Path("images/timestamps.txt")
EXPOSURES: Final = Path("images/left/exposure_timestamps.txt")


@dataclass(frozen=True, kw_only=True)
class SequencePlan:
    """One sequence to render: everything its files depend on.

    Args:
        split: train, val or test.
        index: number within the split.
        height: rows of both cameras.
        width: columns of both cameras.
        frames: number of frames, 20 per second.
        seed: seed of the data set.
        sensor: the event camera.
        camera: the frame camera.
        rule: which actors are labelled.
    """

    split: str
    index: int
    height: int
    width: int
    frames: int
    seed: int
    sensor: EventSensor
    camera: FrameCamera = field(default_factory=FrameCamera)
    rule: LabelRule = field(default_factory=LabelRule)

    @property
    def night(self) -> bool:
        """Every fifth recording."""
        return self.index % 5 == 1

    @property
    def still(self) -> bool:
        """Every twentieth recording is made while waiting, where little but traffic shows."""
        return self.index % 20 == 17

    @property
    def name(self) -> str:
        """Folder name."""
        return f"mini_{self.split}_{self.index:03d}_{'night' if self.night else 'day'}"

    @property
    def key(self) -> tuple[int, int, int]:
        """Integers from which all of the recording's randomness is drawn."""
        return (self.seed, SPLITS[self.split], self.index)

    @property
    def t_offset_us(self) -> int:
        """When the event camera was switched on, on the recording's own clock."""
        rng = np.random.default_rng(np.random.SeedSequence([*self.key, 1]))
        return int(rng.integers(40_000_000_000, 60_000_000_000))

    @property
    def duration_us(self) -> int:
        """How long the event camera records."""
        return LEAD_IN_US + (self.frames - 1) * FRAME_PERIOD_US + LEAD_OUT_US

    @property
    def street(self) -> Street:
        """The street it is recorded in."""
        return Street(
            seed=(*self.key, 0),
            night=self.night,
            still=self.still,
            duration_s=1e-6 * self.duration_us,
        )

    def description(self) -> dict[str, Any]:
        """What the files depend on, to recognise them again."""
        return {**asdict(self), "version": VERSION}

    @classmethod
    def of(cls, description: Mapping[str, Any]) -> SequencePlan:
        """The plan that a description of this version was made of."""
        values = {name: value for name, value in description.items() if name != "version"}
        scanned = "scan_us" in values["sensor"]  # a parameter of that build alone
        sensor = FirstOrderSensor if scanned else ReferenceSensor
        parts = {"sensor": sensor, "camera": FrameCamera, "rule": LabelRule}
        return cls(**values | {name: kind(**values[name]) for name, kind in parts.items()})

    @property
    def frame_times_us(self) -> NDArray[np.int64]:
        """When frames are taken, from when the event camera was switched on."""
        return LEAD_IN_US + FRAME_PERIOD_US * np.arange(self.frames, dtype=np.int64)

    def world(self) -> DrivingWorld:
        """What both cameras see."""
        return DrivingWorld(height=self.height, width=self.width, **asdict(self.street))

    def exposure(self, world: DrivingWorld) -> Exposure:
        """What the frame camera chooses for the recording, by the light in its middle."""
        middle = self.frame_times_us[self.frames // 2]
        return self.camera.meter(world.radiance(float(middle)))

    def write(self, root: Path) -> dict[str, Any]:
        """Render into `root/split/name`, which appears when it is complete.

        A folder that was completed earlier with the same description is kept as it is.

        Returns:
            The sequence's record: counts and description.

        Raises:
            ValueError: a folder of that name is there, which was not written here.
        """
        return self._once(root / self.split / self.name, self._render, self.files)

    def write_events(self, root: Path) -> dict[str, Any]:
        """Write what the event camera alone leaves, into the same folder below another root.

        Raises:
            ValueError: as `write` says.
        """
        return self._once(root / self.split / self.name, self._watch, (EVENTS,))

    @property
    def files(self) -> Sequence[Path]:
        """What a whole recording consists of, below its folder, its record left out."""
        frames = (Path(f"images/left/distorted/{k:06d}.png") for k in range(self.frames))
        return (EVENTS, TRACKS, TIMES, EXPOSURES, *frames)

    def kept(self, root: Path, files: Sequence[Path] = (EVENTS,)) -> dict[str, Any] | None:
        """The record of what lies below `root`, if it was written with this very description.

        Args:
            root: where the recording lies.
            files: what must be there beside the record; links must lead somewhere.
        """
        folder = root / self.split / self.name
        path = folder / RECORD
        if not (path.is_file() and all((folder / each).is_file() for each in files)):
            return None
        record = read_json(path)
        return record if record["description"] == self.description() else None

    def events_file(self, root: Path) -> Path:
        """Where the events lie below a root."""
        return root / self.split / self.name / EVENTS

    def _once(
        self, folder: Path, make: Callable[[Path], dict[str, Any]], files: Sequence[Path]
    ) -> dict[str, Any]:
        record = self.kept(folder.parents[1], files)
        if record is not None:
            return record
        if folder.is_symlink() and not folder.exists():
            raise ValueError(
                f"Expected a recording at {folder}, got a link to {folder.readlink()}, where "
                "nothing is; bring that back, or remove the link"
            )
        if folder.exists() and not (folder / RECORD).is_file():
            raise ValueError(
                f"Expected no folder at {folder} but those written here, got another; set "
                "data.root to a new folder"
            )
        if folder.exists():  # made with another description, or not whole any more
            shutil.rmtree(folder)
        with complete_folder(folder) as partial:
            record = make(partial)
            write_json(partial / RECORD, record)
        return record

    def _watch(self, folder: Path) -> dict[str, Any]:
        events, on = self._write_events(folder, self.world(), self.duration_us)
        return {
            "name": self.name,
            "duration_us": self.duration_us,
            "events": events,
            "on_events": on,
            "description": self.description(),
        }

    def _render(self, folder: Path) -> dict[str, Any]:
        world, times, duration_us = self.world(), self.frame_times_us, self.duration_us
        exposure_us = self._write_frames(folder, world, times)
        boxes = [self.rule.boxes(world.view(int(t)), int(t) + self.t_offset_us) for t in times]
        (folder / TRACKS).parent.mkdir(parents=True)
        tracks = np.concatenate(boxes)
        np.save(folder / TRACKS, tracks)
        events, on = self._write_events(folder, world, duration_us)
        classes, counts = np.unique(tracks["class_id"], return_counts=True)
        return {
            "name": self.name,
            "frames": self.frames,
            "duration_us": duration_us,
            "exposure_us": exposure_us,
            "events": events,
            "on_events": on,
            "boxes": {str(c): int(n) for c, n in zip(classes, counts, strict=True)},
            "occluded_boxes": int((tracks["visibility"] < 0.9).sum()),
            "description": self.description(),
        }

    def _write_frames(self, folder: Path, world: DrivingWorld, times: np.ndarray) -> int:
        pictures = folder / "images/left/distorted"
        pictures.mkdir(parents=True)
        exposure = self.exposure(world)
        for k, t in enumerate(times):
            frame = self.camera.expose(world.radiance, int(t), exposure, (*self.key, 2, k))
            Image.fromarray(frame).save(pictures / f"{k:06d}.png")
        stamps = times + self.t_offset_us
        half = exposure.time_us // 2
        lines = "".join(f"{t}\n" for t in stamps)
        (folder / TIMES).write_text(lines)
        spans = "".join(f"{t - half}, {t + half}\n" for t in stamps)
        (folder / EXPOSURES).write_text("# exposure start, exposure end\n" + spans)
        return exposure.time_us

    def _write_events(self, folder: Path, world: DrivingWorld, duration_us: int) -> tuple[int, int]:
        (folder / EVENTS).parent.mkdir(parents=True)
        stream = self.sensor.start(
            self.height, self.width, noise_key=(*self.key, 3), start_us=self.t_offset_us
        )
        instants = range(0, duration_us + 1, self.sensor.step_us)
        total = on = 0
        with EventWriter(
            folder / EVENTS,
            self.height,
            self.width,
            t_offset_us=self.t_offset_us,
        ) as writer:
            for first in range(0, len(instants), 50):
                part = np.stack([world.radiance(t) for t in instants[first : first + 50]])
                events = stream.step(part)
                writer.append(events)
                total, on = total + len(events), on + int(events.p.sum())
            events = stream.finish()
            writer.append(events)
        return total + len(events), on + int(events.p.sum())
