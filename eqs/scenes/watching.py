"""The events of another event camera, beside recordings whose frames and labels stay."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.progress import track

from eqs.files import one_at_a_time, remove_unfinished
from eqs.processors import available_cores, side_by_side
from eqs.scenes.sensor_stream import EventSensor
from eqs.scenes.sequence import SequencePlan

BESIDE = "_sensors"  # ends the name of the folder beside a data set, with one for each camera


@dataclass(frozen=True, kw_only=True)
class Watching:
    """Another event camera in front of the worlds of a data set.

    Events depend on world and camera alone, so frames and labels are neither rendered nor kept
    again: a folder for each camera, named by the hash of its parameters, holds events only.

    Args:
        recordings: the plans of the data set, by the names of the recordings.
        sensor: the other camera.
        root: where the data set lies.
        workers: processes; None for one per core.
    """

    recordings: Mapping[str, SequencePlan]
    sensor: EventSensor
    root: Path
    workers: int | None = None

    @property
    def folder(self) -> Path:
        """What holds this camera's events."""
        return self.root.with_name(self.root.name + BESIDE) / self.sensor.definition_hash()

    def file(self, name: str) -> Path:
        """Where the events of a recording lie, whether they were made already or not."""
        return self._plan(name).events_file(self.folder)

    def record(self, names: Collection[str]) -> None:
        """Make the events of these recordings that are missing or were made otherwise.

        Interrupted anywhere, the next call keeps the finished ones. Of several processes that ask
        for them at once, one makes them and the others wait.

        Raises:
            ValueError: there is a folder in the way, which was not written here.
        """
        if not self._missing(names):
            return
        work = f"making events of sensor {self.sensor.definition_hash()}"
        with one_at_a_time(self.folder, work) as alone:
            if alone:
                remove_unfinished(self.folder, "*/*")
            jobs = [(plan, self.folder) for plan in self._missing(names)]
            workers = min(self.workers or available_cores(), len(jobs))
            done = map(_write, jobs) if workers <= 1 else side_by_side(_write, jobs, workers)
            for _ in track(done, description=work, total=len(jobs)):
                pass

    def records(self) -> list[dict[str, Any]]:
        """What is said of the events that were made."""
        found = (self._plan(name).kept(self.folder) for name in self.recordings)
        return [record for record in found if record is not None]

    def _missing(self, names: Collection[str]) -> Sequence[SequencePlan]:
        return [plan for plan in map(self._plan, names) if plan.kept(self.folder) is None]

    def _plan(self, name: str) -> SequencePlan:
        return replace(self.recordings[name], sensor=self.sensor)


def _write(job: tuple[SequencePlan, Path]) -> None:
    plan, folder = job
    plan.write_events(folder)
