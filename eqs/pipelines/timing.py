"""How long each phase of a study took, kept across interruptions."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from omegaconf import DictConfig

from eqs.files import read_json, write_json


@dataclass(frozen=True)
class PhaseTimes:
    """Seconds per phase in a JSON file.

    Args:
        path: the file; it need not exist yet.
    """

    path: Path

    def read(self) -> dict[str, float]:
        """Seconds by phase, in the order in which the phases first ran."""
        return read_json(self.path)["phases"] if self.path.exists() else {}

    @contextmanager
    def measure(self, phase: str, *, resumed: bool = False) -> Iterator[None]:
        """Time a block of work; a resumed phase adds to the time it had taken before."""
        start = time.perf_counter()
        try:
            yield
        finally:
            phases = self.read()
            before = phases.get(phase, 0.0) if resumed else 0.0
            phases[phase] = round(before + time.perf_counter() - start, 1)
            write_json(self.path, {"phases": phases})


def phase_times(cfg: DictConfig) -> PhaseTimes:
    """The times of the configured study, beside its results."""
    return PhaseTimes(Path(cfg.paths.results) / cfg.data.name / "timings.json")
