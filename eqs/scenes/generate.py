"""Writes `dsec_mini`: all of its recordings, side by side, and what they are."""

from __future__ import annotations

import json
import shutil
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from eqs.files import PARTIAL, one_at_a_time, read_json, remove_unfinished, write_json
from eqs.processors import available_cores, side_by_side
from eqs.scenes.camera import FrameCamera
from eqs.scenes.labels import LabelRule
from eqs.scenes.sensor import ReferenceSensor
from eqs.scenes.sensor_stream import EventSensor
from eqs.scenes.sequence import RECORD, SPLITS, VERSION, SequencePlan
from eqs.scenes.watching import Watching


@dataclass(frozen=True, kw_only=True)
class DSECMini:
    """The embedded data set: a rendered street seen by a frame camera and a reference sensor.

    Args:
        size: width and height in pixels, as in "128x96".
        sequences: number of recordings per split.
        frames: frames per recording, 20 per second.
        seed: draws every recording; one seed is one data set, whatever the worker count.
        sensor: the event camera whose events lie with the frames.
        other_sensor: another one, whose events are looked at instead; they lie beside, see
            `Watching`.
        workers: processes; None for one per core.

    Raises:
        ValueError: a size, split or count makes no sense.
    """

    size: str = "128x96"
    sequences: Mapping[str, int]
    frames: int = 60
    seed: int = 0
    sensor: EventSensor = field(default_factory=ReferenceSensor)
    other_sensor: EventSensor | None = None
    workers: int | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be generated."""
        width, separator, height = self.size.partition("x")
        if not (separator and width.isdigit() and height.isdigit() and int(width) * int(height)):
            raise ValueError(f"Expected a size like 128x96, got {self.size!r}; set data.size")
        unknown = set(self.sequences) - set(SPLITS)
        if unknown or any(count < 0 for count in self.sequences.values()):
            raise ValueError(
                f"Expected counts for {list(SPLITS)}, got {dict(self.sequences)}; "
                "set data.generator.sequences"
            )
        if self.frames < 2:
            raise ValueError(
                f"Expected at least 2 frames, got {self.frames}; set data.generator.frames"
            )

    @property
    def sensor_hash(self) -> str:
        """Hash of the parameters of the event camera that is looked at."""
        return (self.other_sensor or self.sensor).definition_hash()

    def recordings(self) -> list[SequencePlan]:
        """All sequences, in the order of their names."""
        width, height = (int(number) for number in self.size.split("x"))
        return [
            SequencePlan(
                split=split,
                index=index,
                height=height,
                width=width,
                frames=self.frames,
                seed=self.seed,
                sensor=self.sensor,
            )
            for split, count in self.sequences.items()
            for index in range(count)
        ]

    def generate(self, root: Path | str) -> Path:
        """Render what is missing below `root` and write `manifest.json` last.

        Interrupted anywhere, the next call keeps the finished recordings. Of several processes that
        ask for it at once, one renders and the others wait.

        Returns:
            `root`.

        Raises:
            ValueError: the folder holds files, none of which were written here.
        """
        root = Path(root)
        if not self._is_complete(root):
            with one_at_a_time(root, f"generating {root}") as alone:
                if not self._is_complete(root):
                    require_own_folder(root)
                    if alone:
                        remove_unfinished(root, "*/mini_*")
                    self._generate(root)
        return root

    def events_file(self, root: Path | str, name: str) -> Path | None:
        """Where another sensor's events of a recording lie; None where they lie with the frames."""
        other = self._watching(root)
        return None if other is None else other.file(name)

    def record(self, root: Path | str, names: Collection[str]) -> None:
        """Make another sensor's events of these recordings, where that is chosen and they lack.

        Raises:
            ValueError: a folder is in the way, which was not written here.
        """
        other = self._watching(root)
        if other is not None:
            other.record(names)

    def events_said(self, root: Path | str) -> str:
        """How many events there are by day and by night, in a sentence."""
        other = self._watching(root)
        manifest = Path(root) / "manifest.json"
        records = read_json(manifest)["sequences"] if other is None else other.records()
        plans = {plan.name: plan for plan in self.recordings()}
        width, height = (int(number) for number in self.size.split("x"))
        said = []
        for light in ("day", "night"):
            held = [each for each in records if plans[each["name"]].night == (light == "night")]
            seconds = 1e-6 * sum(each["duration_us"] for each in held)
            if held:
                count, on = (sum(each[key] for each in held) for key in ("events", "on_events"))
                rate = count / seconds
                said.append(
                    f"{rate:,.0f} events per second by {light} ({rate / width / height:.1f} per "
                    f"pixel, {100 * on / max(count, 1):.0f} % ON, {len(held)} recordings)"
                )
        return " and ".join(said)

    def _watching(self, root: Path | str) -> Watching | None:
        if self.other_sensor is None or self.sensor_hash == self.sensor.definition_hash():
            return None
        return Watching(
            recordings={plan.name: plan for plan in self.recordings()},
            sensor=self.other_sensor,
            root=Path(root),
            workers=self.workers,
        )

    def _is_complete(self, root: Path) -> bool:
        manifest = root / "manifest.json"
        if not manifest.is_file():
            return False
        if read_json(manifest).get("parameters") != self._description():
            return False
        # What was deleted since is made again.
        return all(each.kept(root, each.files) is not None for each in self.recordings())

    def _generate(self, root: Path) -> None:
        (root / "manifest.json").unlink(missing_ok=True)  # it speaks of what may now change
        records = sorted(self._records(root), key=lambda record: str(record["name"]))
        self._remove_others(root)
        for record in records:
            del record["description"]
        write_json(
            root / "manifest.json",
            {
                "parameters": self._description(),
                "sensor_hash": self.sensor.definition_hash(),
                "sequences": records,
            },
        )

    def _description(self) -> dict[str, Any]:
        """Everything the files depend on, as it reads back from JSON."""
        description: dict[str, Any] = json.loads(
            json.dumps(
                {
                    "version": VERSION,
                    "size": self.size,
                    "sequences": dict(self.sequences),
                    "frames": self.frames,
                    "seed": self.seed,
                    "sensor": asdict(self.sensor),
                    "camera": asdict(FrameCamera()),
                    "rule": asdict(LabelRule()),
                }
            )
        )
        return description

    def _remove_others(self, root: Path) -> None:
        """Delete recordings of an earlier plan, which would otherwise join the splits."""
        wanted = {root / recording.split / recording.name for recording in self.recordings()}
        for record in root.glob(f"*/mini_*/{RECORD}"):
            if record.parent not in wanted:
                shutil.rmtree(record.parent)

    def _records(self, root: Path) -> list[dict[str, Any]]:
        recordings = self.recordings()
        workers = min(self.workers or available_cores(), len(recordings))
        jobs = [(recording, root) for recording in recordings]
        done = map(_write, jobs) if workers <= 1 else side_by_side(_write, jobs, workers)
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
        )
        with Progress(*columns) as progress:
            description = f"dsec_mini {self.size}"
            return list(progress.track(done, total=len(jobs), description=description))


def require_own_folder(root: Path) -> None:
    """Refuse to generate a data set among files of others.

    Raises:
        ValueError: the folder holds files, none of which were written here.
    """
    ours = ("manifest.json", f"*/mini_*/{RECORD}", f"*/mini_*{PARTIAL}")
    if any(next(root.glob(pattern), None) for pattern in ours):
        return
    found = next((path for path in root.rglob("*") if path.is_file()), None)
    if found is not None:
        raise ValueError(
            f"Expected an empty or a new folder to generate a data set in, got {root} with "
            f"{found.relative_to(root)}; set data=dsec or data=own to read what lies there, or "
            "data.root to another folder"
        )


def _write(job: tuple[SequencePlan, Path]) -> dict[str, Any]:
    recording, root = job
    return recording.write(root)
