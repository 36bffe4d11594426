"""What a finished training measured: written once, read once."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from eqs.files import read_json, write_json
from eqs.metrics import Accuracy
from eqs.names import REFERENCE

Stage = dict[str, float]
"""The share of the training recordings that a detector saw, by simulator or `real`."""


@dataclass(frozen=True, kw_only=True)
class RunResult:
    """The record of a finished run, `result.json`.

    Args:
        simulator: name of the simulator, or `real`.
        system: name of the very stream, which differs with every setting.
        seed: of the training.
        recipe: hash of every setting that a training depends on but stream and seed.
        data: hash of what the recordings hold.
        own: accuracy on the test events of the stream that was trained on.
        real: accuracy on the real test events.
        protocol: what counted, with its hash.
        seconds: how long training and testing took, as far as this process did them.
        stages: what the detector was trained on, one after the other; more than one where it
            started from the weights of another run.
        caveat: why its simulator is none like others; empty where it is one.
        setting: what its simulator saw of frames, in words.
        sensor: the event camera of the real events, name and hash; empty where that is the data
            set's own.
        tested_on: hash of the test recordings, where these were chosen after the training.
    """

    simulator: str
    system: str
    seed: int
    recipe: str
    data: str
    own: Accuracy
    real: Accuracy
    protocol: dict[str, Any]
    seconds: float
    stages: tuple[Stage, ...]
    caveat: str = ""
    setting: str = ""
    sensor: str = ""
    tested_on: str = ""

    @property
    def saw_real(self) -> bool:
        """Whether it was trained on real events, at any stage."""
        return any(REFERENCE in stage for stage in self.stages)

    @property
    def plain(self) -> bool:
        """Whether it was trained from the start on all recordings of one stream."""
        return self.stages == ({self.simulator: 1.0},)

    @property
    def trained_on(self) -> str:
        """All stages in words, as in `esim 100 % + real 10 %` and `esim then real`."""
        return " then ".join(map(stage_words, self.stages))

    @property
    def before(self) -> str:
        """All stages but the last in words; empty where there was but one."""
        return " then ".join(map(stage_words, self.stages[:-1]))

    @property
    def beside(self) -> str:
        """What the last stage held but real events, in words; empty where these were alone."""
        return stage_words({k: v for k, v in self.stages[-1].items() if k != REFERENCE})

    @property
    def real_share(self) -> float:
        """Share of the real training recordings that the last stage held."""
        return self.stages[-1].get(REFERENCE, 0.0)

    def save(self, path: Path) -> None:
        """Write the record; it is there whole or not at all."""
        write_json(path, asdict(self))

    @classmethod
    def load(cls, path: Path) -> RunResult:
        """Read the record.

        Raises:
            ValueError: the record lacks something, as those of older versions may.
        """
        record = read_json(path)
        try:
            own, real = (Accuracy(**record[stream]) for stream in ("own", "real"))
            record.setdefault("stages", [{record["simulator"]: 1.0}])  # before there were others
            for name in ("caveat", "setting", "sensor", "tested_on"):
                record.setdefault(name, "")
            kept = {field.name: record[field.name] for field in fields(cls)}
        except (KeyError, TypeError) as error:
            raise ValueError(
                f"Expected the record of a finished run in {path}, got one that lacks or adds "
                f"{error}; delete the folder, which train.py makes anew, or set paths.runs"
            ) from error
        return cls(**{**kept, "own": own, "real": real, "stages": tuple(kept["stages"])})


def stage_words(stage: Stage) -> str:
    """A stage in words.

    Example:
        >>> stage_words({"esim": 1.0, "real": 0.07}), stage_words({"esim": 1.0})
        ('esim 100 % + real 7 %', 'esim')
    """
    if list(stage.values()) == [1.0]:
        return next(iter(stage))
    return " + ".join(f"{name} {100 * share:g} %" for name, share in stage.items())
