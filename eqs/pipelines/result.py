"""What a finished training measured: written once, read once."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from eqs.files import read_json, write_json
from eqs.metrics import Accuracy


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
            kept = {field.name: record[field.name] for field in fields(cls)}
        except (KeyError, TypeError) as error:
            raise ValueError(
                f"Expected the record of a finished run in {path}, got one that lacks or adds "
                f"{error}; delete the folder, which train.py makes anew, or set paths.runs"
            ) from error
        return cls(**{**kept, "own": own, "real": real})
