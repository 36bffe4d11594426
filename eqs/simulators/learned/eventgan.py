"""EventGAN: a network that learned events between two frames from a sensor.

Zhu, Wang, Khant and Daniilidis, "EventGAN: Leveraging Large Scale Image Datasets for Event
Cameras", ICCP 2021.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np

from eqs.files import complete_file, file_sha256, read_json, short_hash, write_json
from eqs.simulators.learned.volume_network import Counts, Levels, VolumeNetwork, one_thread
from eqs.simulators.pixel.randomness import draw_key, normal_map
from eqs.simulators.streaming.pixels import Interval

RECORD = "record.json"
FOLDS = 2


class Teacher(Protocol):
    """The data set whose events a network learns from."""

    @property
    def name(self) -> str: ...  # noqa: D102

    @property
    def sensor_hash(self) -> str | None: ...  # noqa: D102


@dataclass(frozen=True, kw_only=True)
class Learning:
    """What EventGAN's network is learned from, and how; it lies in a folder named after both.

    Two networks are learned, each from every other recording of the teacher's train split. What one
    learned from the other simulates, so that no detector is trained on events that a network had by
    heart.

    Args:
        teacher: the data set whose events are learned.
        root: where networks are kept.
        width: channels of the generator at full size.
        epochs: how long each network learns.
        steps_per_epoch: batches in an epoch.
        batch_size: pairs of frames in a batch.
        learning_rate: of the generator, which falls to nothing along a cosine.
        coarse_weight: of the likelihood of counts over 4x4 pixels and all bins.
        adversarial_weight: of the critic's opinion, 0 for none; ten times more makes events rare.
        adversarial_after_epochs: when the critic starts.
        seed: of weights, batches and noise.
    """

    teacher: Teacher | None
    root: str | Path
    width: int = 16
    epochs: int = 20
    steps_per_epoch: int = 100
    batch_size: int = 8
    learning_rate: float = 2e-3
    coarse_weight: float = 0.5
    adversarial_weight: float = 2e-4
    adversarial_after_epochs: int = 5
    seed: int = 0

    @property
    def taught_by(self) -> Teacher:
        """The teacher.

        Raises:
            ValueError: there is none, as where there is but a clip.
        """
        if self.teacher is None:
            raise ValueError(
                "Expected a data set to learn events from, got none; set data=dsec_mini, or "
                "sim=eventgan, which learns from a rendered one"
            )
        return self.teacher

    def recipe(self) -> dict[str, Any]:
        """What the networks depend on beside the teacher's recordings."""
        teacher = [self.taught_by.name, self.taught_by.sensor_hash]
        own = {field.name: getattr(self, field.name) for field in fields(self)}
        del own["root"]
        return {**own, "teacher": teacher}

    @property
    def folder(self) -> Path:
        """Where the networks and their record lie."""
        name = f"eventgan-{self.taught_by.name}-{short_hash(self.recipe())}"
        return Path(self.root) / name

    @property
    def finished(self) -> bool:
        """Whether they are there; the record is written last."""
        return (self.folder / RECORD).is_file()

    def record(self) -> dict[str, Any]:
        """What was learned from what.

        Raises:
            FileNotFoundError: nothing was learned yet.
        """
        if not self.finished:
            raise FileNotFoundError(
                f"Expected the networks of eventgan at {self.folder}, found none; type eqs "
                "train-simulator sim=eventgan first, with the same overrides"
            )
        return read_json(self.folder / RECORD)

    def weights(self, fold: int) -> Path:
        """The file of one network."""
        return self.folder / f"fold{fold}.pt"

    def keep(self, fold: int, state: Any) -> None:  # noqa: ANN401 - torch is not loaded yet
        """Write one network."""
        import torch

        # By way of memory: a file that torch names itself holds that name, and so another hash.
        content = BytesIO()
        torch.save(state, content)
        with complete_file(self.weights(fold)) as partial:
            partial.write_bytes(content.getvalue())

    def finish(self, record: Mapping[str, Any]) -> None:
        """Write, last, what was learned from what: `teacher`, `data`, `folds` and `val`."""
        write_json(self.folder / RECORD, record)


@dataclass(frozen=True, kw_only=True)
class EventGAN(VolumeNetwork):
    """Integrates and fires what a network learned that a sensor fires between two frames.

    The original ends at normalised event volumes, without absolute counts. This network learns
    expected counts per polarity in ten bins of the interval, by their likelihood and by a critic
    that sees sampled counts, so that numbers of events come out right. Noise enters each pixel of
    each frame, as the critic asks for events that the frames do not explain.

    Light, interpolation and lens are refused: it learned display values and whole intervals.

    Args:
        network: what it learned, and from what.
        fold: which of its networks simulates: `auto` for the one that did not learn from the
            recording, `0` or `1`.
        shortest_us: the network learned intervals of 50 ms; how short ones it may be used on.
        longest_us: and how long ones.
        seed: of phases and noise.

    Raises:
        ValueError: the fold is none of these, or there is light, interpolation or a lens.
    """

    name: ClassVar[str] = "eventgan"

    network: Learning  # type: ignore[assignment]
    fold: str = "auto"
    shortest_us: int = 25_000
    longest_us: int = 100_000

    def __post_init__(self) -> None:
        """Check the choices."""
        object.__setattr__(self, "fold", str(self.fold))  # typed as a number on a command line
        if self.fold not in ("auto", "0", "1"):
            raise ValueError(f"Expected fold auto, 0 or 1, got {self.fold!r}; set sim.fold")
        for part, why in (
            ("light", "display values"),
            ("interpolation", "whole intervals"),
            ("lens", "frames as they are"),
        ):
            if getattr(self, part) is not None:
                raise ValueError(
                    f"Expected no {part} for eventgan, which learned {why}; set {part}=none"
                )
        object.__setattr__(self, "learned_from", self.network.taught_by.name)
        super().__post_init__()

    def _network_parameters(self) -> dict[str, Any]:
        self.network.record()
        digests = [file_sha256(self.network.weights(fold)) for fold in range(FOLDS)]
        return {"network": digests, "network_name": ""}

    def fold_of(self, sequence: str) -> int:
        """Which network simulates a recording."""
        if self.fold != "auto":
            return int(self.fold)
        learned = self.network.record()["folds"]
        return next((fold for fold in range(FOLDS) if sequence not in learned[fold]), 0)

    def expected(self, first: Levels, second: Levels, sequence: str, interval: Interval) -> Counts:
        """See `VolumeNetwork`."""
        import torch

        from eqs.models.volumes import BINS, generator_input

        weights = self.network.weights(self.fold_of(sequence))
        generator = _generator(weights, weights.stat().st_mtime_ns, self.network.width)
        key = draw_key(self.seed, "eventgan", sequence, str(interval.frame))
        noise = normal_map(key, first.size).astype(np.float32).reshape(first.shape)
        with one_thread():
            frames = (torch.from_numpy(each)[None] for each in (first, second, noise))
            counts: Counts = generator(generator_input(*frames))[0].numpy()
        return counts.reshape(2, BINS, *first.shape)


@lru_cache(maxsize=4)
def _generator(weights: Path, _: int, width: int) -> Any:  # noqa: ANN401 - torch is not loaded yet
    import torch

    from eqs.models.volumes import VolumeGenerator

    generator = VolumeGenerator(width)
    generator.load_state_dict(torch.load(weights, map_location="cpu", weights_only=True))
    return generator.eval()
