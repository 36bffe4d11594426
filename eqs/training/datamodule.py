"""The data side of a training: which events feed which phase."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Protocol, runtime_checkable

import lightning
from torch.utils.data import DataLoader, Sampler

from eqs.data.labels import LabelProtocol
from eqs.data.recording import Recording
from eqs.events import EventReader
from eqs.training.augmentation import Augmentation
from eqs.training.datasets import Batch, EvaluationDataset, TrainingDataset
from eqs.training.window_source import Binning, WindowSource, check_boxes, said_of

log = logging.getLogger(__name__)


class Splits(Protocol):
    """A data set dealt to train, val and test."""

    def recordings(self, split: str) -> list[Recording]:
        """The recordings of one split."""


class EventPaths(Protocol):
    """Knows where the events of a recording lie."""

    def path(self, recording: Recording) -> Path:
        """The recording's event file."""


@runtime_checkable
class TrainingFiles(Protocol):
    """Says which recordings are trained on, each with which events."""

    def training_files(self, recordings: Sequence[Recording]) -> list[tuple[Recording, Path]]:
        """Recordings and event files to train on; a recording may occur with several."""


def check_whole_numbers(values: Mapping[str, object], least: int) -> None:
    """Refuse settings that are no whole numbers from `least` on, by their configuration keys.

    Raises:
        ValueError: one of them is none.
    """
    for key, value in values.items():
        if not isinstance(value, int) or value < least:
            raise ValueError(
                f"Expected {key} to be a whole number of at least {least}, got {value!r}; set {key}"
            )


class StepSampler(Sampler[int]):
    """The steps of one training epoch: `epoch * steps, ..., (epoch + 1) * steps - 1`.

    Epochs only pace validation and checkpoints. What a step holds depends on its number alone, so
    a training resumed at an epoch's start goes on exactly as one that was never interrupted.
    """

    def __init__(self, steps: int, epoch: int = 0) -> None:
        """Start with the given epoch."""
        self.steps = steps
        self.epoch = epoch

    def set_epoch(self, epoch: int) -> None:
        """Choose the epoch; the trainer calls this before each one."""
        self.epoch = epoch

    def __iter__(self) -> Iterator[int]:
        """The steps of the chosen epoch."""
        return iter(range(self.epoch * self.steps, (self.epoch + 1) * self.steps))

    def __len__(self) -> int:
        """Steps per epoch."""
        return self.steps


class EventDataModule(lightning.LightningDataModule):
    """Training, validation and test batches of one data set.

    Training and validation read the events of one source, which may choose what is trained on
    (`TrainingFiles`). Each test stream reads those of its own, from the same recordings, so that
    only the events differ between the tests.

    With several processes each trains its own slots and evaluates its own recordings; the trainer
    must leave the samplers alone (`use_distributed_sampler: false`).

    Args:
        dataset: the recordings of each split.
        protocol: which boxes count.
        source: the events to train and validate on.
        tests: the events of each test stream, by its name; the order is that of the loaders.
        seed: what all draws depend on.
        batch_size: samples per batch, over all processes.
        sequence_length: windows per sample.
        steps_per_epoch: training steps between two ends of an epoch.
        epochs: number of epochs.
        stream_share: share of the samples that play whole recordings; the others are random.
        augmentation: random changes to training samples; none if None.
        bins: time bins per polarity.
        window_us: length of a window.
        count_cutoff: a count stops growing here.
        histogram_cache: folder that keeps histograms once they are binned; None for none.
        evaluation_length: windows per evaluation item; results do not depend on it.
        num_workers: processes that read beside the training; batches do not depend on it.

    Raises:
        ValueError: a number is not a whole one or too small.
    """

    def __init__(
        self,
        dataset: Splits,
        protocol: LabelProtocol,
        source: EventPaths,
        tests: Mapping[str, EventPaths],
        *,
        seed: int = 0,
        batch_size: int = 8,
        sequence_length: int = 5,
        steps_per_epoch: int = 100,
        epochs: int = 20,
        stream_share: float = 0.5,
        augmentation: Augmentation | None = None,
        bins: int = 10,
        window_us: int = 50_000,
        count_cutoff: int = 10,
        histogram_cache: Path | str | None = None,
        evaluation_length: int = 10,
        num_workers: int = 0,
    ) -> None:
        """Keep the parts; nothing is read yet."""
        super().__init__()
        positive = {
            "recipe.epochs": epochs,
            "recipe.steps_per_epoch": steps_per_epoch,
            "recipe.batch_size": batch_size,
            "recipe.sequence_length": sequence_length,
            "datamodule.bins": bins,
            "datamodule.window_us": window_us,
            "datamodule.count_cutoff": count_cutoff,
        }
        check_whole_numbers(positive, least=1)
        check_whole_numbers({"datamodule.num_workers": num_workers, "seed": seed}, least=0)
        self.dataset, self.protocol, self.source, self.tests = dataset, protocol, source, tests
        self.binning = Binning(bins=bins, window_us=window_us, count_cutoff=count_cutoff)
        self.histogram_cache = None if histogram_cache is None else Path(histogram_cache)
        self.seed, self.batch_size, self.sequence_length = seed, batch_size, sequence_length
        self.steps_per_epoch, self.epochs = steps_per_epoch, epochs
        self.stream_share, self.augmentation = stream_share, augmentation
        self.evaluation_length, self.num_workers = evaluation_length, num_workers
        self._looked = False

    def prepare_data(self) -> None:
        """Open every event file before the first step, so that no fault waits for the last test.

        It says what the detector will not see as one would think: labels that belong to no frame,
        frames without events, and windows that are not as long as the frames are apart.

        Raises:
            FileNotFoundError: an event file is missing.
            ValueError: an event file is damaged or runs on another clock than its frames, labels
                belong to no frame, or the test recordings have no boxes.
        """
        if self._looked:  # the trainer asks again before it tests
            return
        streams = [("train", "train", self.source), ("val", "val", self.source)]
        streams += [("test", f"test ({name})", events) for name, events in self.tests.items()]
        for split, named, events in streams:
            sources = self.sources(split, events)
            for source in sources:
                source.check()
            if split == "test":
                check_boxes(sources)
            for sentence in said_of(sources):
                log.warning("%s: %s", named, sentence)
        self._looked = True

    def training_dataset(self, rank: int = 0, world_size: int = 1) -> TrainingDataset:
        """The training batches of one process."""
        return TrainingDataset(
            self.sources("train", self.source),
            seed=self.seed,
            steps=self.epochs * self.steps_per_epoch,
            batch_size=self.batch_size,
            sequence_length=self.sequence_length,
            stream_share=self.stream_share,
            augmentation=self.augmentation,
            rank=rank,
            world_size=world_size,
        )

    def evaluation_dataset(
        self, split: str, events: EventPaths, rank: int = 0, world_size: int = 1
    ) -> EvaluationDataset:
        """Every window of a split, or of one process's share of its recordings.

        Raises:
            ValueError: there are fewer recordings than processes, or they differ in size.
        """
        sources = self.sources(split, events)
        if 0 < len(sources) < world_size:  # idle processes would leave the others waiting
            raise ValueError(
                f"Expected a {split} recording for each of {world_size} processes, got "
                f"{len(sources)}; set trainer.devices or data.splits"
            )
        return EvaluationDataset(sources[rank::world_size], chunk_length=self.evaluation_length)

    def sources(self, split: str, events: EventPaths) -> list[WindowSource]:
        """The recordings of a split with the events of one source; of train, those it chooses."""
        recordings = self.dataset.recordings(split)
        if split == "train" and isinstance(events, TrainingFiles):
            files = events.training_files(recordings)
        else:
            files = [(recording, events.path(recording)) for recording in recordings]
        return [
            WindowSource(
                recording=recording,
                events_path=path,
                protocol=self.protocol,
                binning=self.binning,
                cache=self.histogram_cache,
                span_us=self._span_of_tests(recording) if split == "test" else None,
            )
            for recording, path in files
        ]

    def _span_of_tests(self, recording: Recording) -> tuple[int, int] | None:
        """The time that every test stream was watched, so that all count the same frames."""
        size = recording.height, recording.width
        extents = []
        for events in self.tests.values():
            with EventReader(events.path(recording), *size) as reader:
                extents += [reader.extent_us] if reader.extent_us else []
        if not extents:
            return None
        start = max(first for first, _ in extents)
        return start, max(start, min(last for _, last in extents))

    def train_dataloader(self) -> DataLoader[Batch]:
        """The batches of one epoch."""
        # A resumed trainer takes its first batch before it names the epoch.
        done = self.trainer.fit_loop.total_batch_idx + 1 if self.trainer else 0
        sampler = StepSampler(self.steps_per_epoch, epoch=done // self.steps_per_epoch)
        return self._loader(self.training_dataset(*self._process()), sampler)

    def val_dataloader(self) -> DataLoader[Batch]:
        """The validation recordings with the events that the training uses."""
        return self._loader(self.evaluation_dataset("val", self.source, *self._process()))

    def test_dataloader(self) -> Sequence[DataLoader[Batch]]:
        """The test recordings with the events of each test stream."""
        return [
            self._loader(self.evaluation_dataset("test", events, *self._process()))
            for events in self.tests.values()
        ]

    def _process(self) -> tuple[int, int]:
        """Number of this process and of all of them."""
        return (self.trainer.global_rank, self.trainer.world_size) if self.trainer else (0, 1)

    def _loader(
        self, dataset: TrainingDataset | EvaluationDataset, sampler: Sampler[int] | None = None
    ) -> DataLoader[Batch]:
        return DataLoader(
            dataset,
            batch_size=None,
            sampler=sampler,
            num_workers=self.num_workers,
            persistent_workers=sampler is not None and self.num_workers > 0,
        )
