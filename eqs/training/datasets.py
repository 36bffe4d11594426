"""Batches of windows: histograms binned from event files on the fly, with their labels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property, partial
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import Dataset

from eqs.data.labels import LabelProtocol, detector_rows
from eqs.data.recording import Recording
from eqs.data.windows import detection_windows
from eqs.events import EventReader
from eqs.files import short_hash
from eqs.representations import HISTOGRAM_VERSION, stacked_histogram
from eqs.training.augmentation import Augmentation, View, visible
from eqs.training.histogram_cache import cached_histogram
from eqs.training.sampling import Chunk, Schedule, keyed_generator

Batch = dict[str, Tensor]
LabelledBoxes = tuple[NDArray[np.float32], NDArray[np.int64]]


@dataclass(frozen=True, kw_only=True)
class Binning:
    """How a window of events becomes a histogram.

    Args:
        bins: time bins per polarity.
        window_us: length of a window.
        count_cutoff: a count stops growing here.
    """

    bins: int = 10
    window_us: int = 50_000
    count_cutoff: int = 10


@dataclass(frozen=True, kw_only=True, eq=False)
class WindowSource:
    """One recording cut into the windows that end at its frames.

    The event file is opened at the first use, in the process that uses it.

    Args:
        recording: frame times and labels.
        events_path: the events to look at, recorded or simulated.
        protocol: which boxes count.
        binning: how windows become histograms.
        cache: folder that keeps the histograms; None to bin the events at every use.
    """

    recording: Recording
    events_path: Path
    protocol: LabelProtocol
    binning: Binning = field(default_factory=Binning)
    cache: Path | None = None
    windows_us: NDArray[np.int64] = field(init=False, repr=False)
    reader: EventReader = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Derive the windows and prepare the reader."""
        recording = self.recording
        windows = detection_windows(recording.frame_times_us, self.binning.window_us)
        reader = EventReader(
            self.events_path,
            recording.height,
            recording.width,
            rows=self.protocol.rows(recording.height),
        )
        object.__setattr__(self, "windows_us", windows)
        object.__setattr__(self, "reader", reader)

    def __len__(self) -> int:
        """Number of windows."""
        return len(self.windows_us)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Channels, rows and columns of a histogram."""
        rows = self.protocol.rows(self.recording.height)
        return 2 * self.binning.bins, rows, self.recording.width

    def histogram(self, index: int) -> NDArray[np.uint8]:
        """The histogram of one window, uint8, shape `self.shape`."""
        if self._kept is None:
            return self._binned(index)
        path = self._kept / f"{self.windows_us[index, 1]}.h5"
        return cached_histogram(path, partial(self._binned, index), self.shape)

    @cached_property
    def _kept(self) -> Path | None:
        """Where the histograms of these very events lie, binned this way."""
        if self.cache is None:
            return None
        file = self.events_path.stat()
        events = [str(self.events_path.resolve()), file.st_size, file.st_mtime_ns]
        key = short_hash([HISTOGRAM_VERSION, events, asdict(self.binning), self.shape])
        return self.cache / f"{self.recording.name}-{key}"

    def _binned(self, index: int) -> NDArray[np.uint8]:
        start_us, stop_us = (int(time) for time in self.windows_us[index])
        return stacked_histogram(
            self.reader.window(start_us, stop_us),
            bins=self.binning.bins,
            start_us=start_us,
            stop_us=stop_us,
            count_cutoff=self.binning.count_cutoff,
        )

    def check_events(self) -> None:
        """Open the event file and see whether its events belong to the frames.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: the file is damaged, or no event lies between the first and last frame.
        """
        if not len(self):
            return
        first, last = (int(time) for time in self.recording.frame_times_us[[0, -1]])
        with self.reader as events:
            apart = events.start_us > last or events.stop_us <= first
            if len(events) and apart:
                raise ValueError(
                    f"Expected events and frames of one clock in {self.events_path}, got events "
                    f"from {events.start_us} to {events.stop_us} us and frames from {first} to "
                    f"{last} us; correct t_offset or the frames' times"
                )

    def boxes(self, index: int) -> LabelledBoxes:
        """Boxes x1 y1 x2 y2 and classes at the end of one window."""
        rows = self.recording.tracks_at(int(self.windows_us[index, 1]))
        return self.protocol.select(rows, self.recording.height, self.recording.width)

    def counts(self, boxes: NDArray[np.float32]) -> bool:
        """Whether a frame with these boxes takes part in training and evaluation."""
        return self.recording.has_labels and (self.protocol.score_empty_frames or len(boxes) > 0)

    def labelled_windows(self) -> NDArray[np.int64]:
        """Indices of the windows whose frames take part, int64."""
        indices = [index for index in range(len(self)) if self.counts(self.boxes(index)[0])]
        return np.array(indices, np.int64)


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
            labelled=[source.counts(each) for each, _ in boxes],
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
            labelled=[source.counts(each) for each, _ in boxes],
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


def check_boxes(sources: Sequence[WindowSource]) -> None:
    """Refuse recordings in which there is nothing to find, on which no detector can be tested.

    Raises:
        ValueError: no recording has a box that counts.
    """
    if not any(len(source.boxes(index)[0]) for source in sources for index in range(len(source))):
        names = ", ".join(source.recording.name for source in sources)
        raise ValueError(
            f"Expected labelled boxes to test on, got none that counts in {names}; set data.root "
            "or data.splits to labelled recordings, or protocol.classes and sizes to their boxes"
        )


def check_sizes(sources: Sequence[WindowSource]) -> None:
    """Refuse recordings that cannot share a batch.

    Raises:
        ValueError: there is no recording with windows, or the recordings differ in size.
    """
    if not any(len(source) for source in sources):
        raise ValueError(
            "Expected recordings of two frames or more, got none; set data.root or data.splits"
        )
    sizes = {f"{source.shape[2]}x{source.shape[1]}" for source in sources}
    if len(sizes) > 1:
        raise ValueError(
            f"Expected recordings of one size, got {', '.join(sorted(sizes))}; set data.splits to "
            "recordings of one sensor"
        )
