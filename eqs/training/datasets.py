"""Batches of windows: histograms binned from event files on the fly, with their labels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import Dataset

from eqs.data.labels import detector_rows
from eqs.training.augmentation import Augmentation, View, visible
from eqs.training.sampling import Chunk, Schedule, keyed_generator
from eqs.training.window_source import LabelledBoxes, WindowSource, check_sizes

Batch = dict[str, Tensor]


@dataclass
class Sample:
    """A run of windows of one recording, with the label rows of each window."""

    histograms: NDArray[np.uint8]
    labels: list[NDArray[np.float32]]
    labelled: list[bool]


class TrainingDataset(Dataset[Batch]):
    """The batch of every training step; the index is the step.

    A batch holds `histograms` uint8 (T, B, 2 * bins, H, W), `labels` float32 (T, B, M, 5) with rows
    (class, centre x, centre y, width, height) and zero rows as padding, `labelled` bool (T, B),
    `first` bool (B,) and `stream` bool (B,). Windows past a recording's end are zero, unlabelled.

    Args:
        sources: the recordings, of one size.
        seed: what all draws depend on.
        steps: number of steps.
        batch_size: samples per batch, over all processes.
        sequence_length: windows per sample, T.
        stream_share: share of the samples that play whole recordings; the others are random.
        augmentation: random changes; none if None.
        rank: number of this process among those that train together.
        world_size: number of those processes.

    Raises:
        ValueError: the recordings differ in size, have no windows or no labels.
    """

    def __init__(
        self,
        sources: Sequence[WindowSource],
        *,
        seed: int,
        steps: int,
        batch_size: int,
        sequence_length: int,
        stream_share: float = 0.5,
        augmentation: Augmentation | None = None,
        rank: int = 0,
        world_size: int = 1,
    ) -> None:
        """Check the recordings and lay out the schedule."""
        self.sources = [source for source in sources if len(source)]
        self.steps = steps
        self.augmentation = augmentation
        check_sizes(self.sources)
        self.schedule = Schedule(
            seed=seed,
            window_counts=tuple(len(source) for source in self.sources),
            batch_size=batch_size,
            sequence_length=sequence_length,
            stream_share=stream_share,
            ends=tuple(source.labelled_windows() for source in self.sources),
            rank=rank,
            world_size=world_size,
        )

    def __len__(self) -> int:
        """Number of steps."""
        return self.steps

    def __getitem__(self, step: int) -> Batch:
        """The batch of one step."""
        schedule = self.schedule
        chunks = [schedule.chunk(step, position) for position in range(schedule.slots)]
        batch = collate([self._sample(chunk) for chunk in chunks], schedule.sequence_length)
        batch["first"] = torch.tensor([chunk.first for chunk in chunks])
        batch["stream"] = torch.tensor([chunk.stream for chunk in chunks])
        return batch

    def _sample(self, chunk: Chunk) -> Sample:
        source = self.sources[chunk.recording]
        indices = range(chunk.start, chunk.start + chunk.count)
        histograms = np.stack([source.histogram(index) for index in indices])
        boxes = [source.boxes(index) for index in indices]
        if self.augmentation is not None:
            generator = keyed_generator(self.schedule.seed, "augment", *chunk.key)
            draw = partial(self.augmentation.draw, generator, stream=chunk.stream)
            histograms, boxes = seen_through(draw, histograms, boxes)
        return Sample(
            histograms=histograms,
            labels=[detector_rows(*each) for each in boxes],
            labelled=[source.counts(i, each) for i, (each, _) in zip(indices, boxes, strict=True)],
        )


class EvaluationDataset(Dataset[Batch]):
    """All windows of some recordings in order, a chunk per item.

    An item looks like a training batch of one sample, with `times_us` int64 (T,), the end of each
    window, and `recording` int64 (1,), the index of the recording. A recording's last chunk is as
    short as what is left. States start from zero at each recording.

    Args:
        sources: the recordings.
        chunk_length: windows per item.

    Raises:
        ValueError: the recordings differ in size or have no windows.
    """

    def __init__(self, sources: Sequence[WindowSource], *, chunk_length: int = 10) -> None:
        """Lay out the chunks."""
        self.sources = list(sources)
        check_sizes(self.sources)
        self.chunks = [
            (number, start, min(start + chunk_length, len(source)))
            for number, source in enumerate(self.sources)
            for start in range(0, len(source), chunk_length)
        ]

    def __len__(self) -> int:
        """Number of chunks."""
        return len(self.chunks)

    def __getitem__(self, index: int) -> Batch:
        """The windows of one chunk."""
        number, start, stop = self.chunks[index]
        source = self.sources[number]
        boxes = [source.boxes(window) for window in range(start, stop)]
        sample = Sample(
            histograms=np.stack([source.histogram(window) for window in range(start, stop)]),
            labels=[detector_rows(*each) for each in boxes],
            labelled=[source.counts(start + n, each) for n, (each, _) in enumerate(boxes)],
        )
        batch = collate([sample], stop - start)
        batch["first"] = torch.tensor([start == 0])
        batch["stream"] = torch.tensor([True])
        batch["times_us"] = torch.from_numpy(source.windows_us[start:stop, 1].copy())
        batch["recording"] = torch.tensor([number])
        return batch


def seen_through(
    draw: Callable[[NDArray[np.float32], int, int], View],
    histograms: NDArray[np.uint8],
    boxes: list[LabelledBoxes],
) -> tuple[NDArray[np.uint8], list[LabelledBoxes]]:
    """A sample in one drawn view; boxes that the view hides are left out."""
    height, width = histograms.shape[-2:]
    newest = next((each for each, _ in reversed(boxes) if len(each)), boxes[-1][0])
    view = draw(newest, height, width)
    moved = [(view.boxes(each, height, width), labels) for each, labels in boxes]
    kept = [(each[visible(each)], labels[visible(each)]) for each, labels in moved]
    return view.picture(histograms), kept


def collate(samples: Sequence[Sample], length: int) -> Batch:
    """Samples side by side, padded to `length` windows and to the most boxes of any window."""
    most = max(1, *(len(rows) for sample in samples for rows in sample.labels))
    shape = samples[0].histograms.shape[1:]
    histograms = np.zeros((length, len(samples), *shape), np.uint8)
    labels = np.zeros((length, len(samples), most, 5), np.float32)
    labelled = np.zeros((length, len(samples)), np.bool_)
    for column, sample in enumerate(samples):
        histograms[: len(sample.histograms), column] = sample.histograms
        labelled[: len(sample.labelled), column] = sample.labelled
        for time, rows in enumerate(sample.labels):
            labels[time, column, : len(rows)] = rows
    return {
        "histograms": torch.from_numpy(histograms),
        "labels": torch.from_numpy(labels),
        "labelled": torch.from_numpy(labelled),
    }
