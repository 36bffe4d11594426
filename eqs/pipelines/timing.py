"""How long each phase of a study took, kept across interruptions and parallel commands."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from omegaconf import DictConfig

from eqs.files import read_json, write_json
from eqs.pipelines.sensors import results_folder


@dataclass(frozen=True)
class PhaseTimes:
    """Seconds per phase, a small file each, so that commands side by side do not collide.

    Args:
        folder: where the files lie; it need not exist yet.
    """

    folder: Path

    def read(self) -> dict[str, float]:
        """Seconds by phase, in the order in which the phases were begun."""
        records = [read_json(path) for path in self.folder.glob("*.json")]
        records.sort(key=lambda record: record["begun"])
        return {record["phase"]: record["seconds"] for record in records}

    @contextmanager
    def measure(self, phase: str, *, resumed: bool = False) -> Iterator[None]:
        """Time a block of work; a resumed phase adds to the time it had taken before."""
        path = self.folder / f"{phase.replace(' ', '-')}.json"
        before = read_json(path) if resumed and path.exists() else {}
        begun, start = before.get("begun", time.time()), time.perf_counter()
        try:
            yield
        finally:
            seconds = before.get("seconds", 0.0) + time.perf_counter() - start
            write_json(path, {"phase": phase, "seconds": round(seconds, 1), "begun": begun})


def phase_times(cfg: DictConfig) -> PhaseTimes:
    """The times of the configured study, beside its results."""
    return PhaseTimes(results_folder(cfg) / "timings")
