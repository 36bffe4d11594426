"""One recording as a detector sees it: windows of events that end at labelled frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eqs.content import content_hash
from eqs.data.labels import LabelProtocol
from eqs.data.matching import MatchedLabels
from eqs.data.recording import Recording
from eqs.data.windows import detection_windows, seen_between_frames
from eqs.events import EventReader
from eqs.files import short_hash
from eqs.representations import HISTOGRAM_VERSION, stacked_histogram
from eqs.training.histogram_cache import cached_histogram

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
        span_us: start and stop of the time in which every stream that is compared was watched; by
            default that of this one.
    """

    recording: Recording
    events_path: Path
    protocol: LabelProtocol
    binning: Binning = field(default_factory=Binning)
    cache: Path | None = None
    span_us: tuple[int, int] | None = None
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
        events = content_hash(self.events_path)
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

    def check(self) -> None:
        """Open the event file and see whether events and labels belong to the frames.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: the file is damaged or empty, no event lies between the first and last
                frame, or too few labels belong to a frame.
        """
        if not len(self):
            return
        first, last = (int(time) for time in self.recording.frame_times_us[[0, -1]])
        with self.reader as events:
            if events.extent_us is None:
                raise ValueError(
                    f"Expected events in {self.events_path}, got none, nor the time that was "
                    "watched; replace the file"
                )
            start, stop = events.extent_us
            if start > last or stop <= first:
                raise ValueError(
                    f"Expected events and frames of one clock in {self.events_path}, got events "
                    f"from {start} to {stop} us and frames from {first} to {last} us; correct "
                    "t_offset or the frames' times"
                )
        labels = self.labels
        if labels.share < self.protocol.least_matched_labels:
            raise ValueError(
                f"Expected labels within {self.protocol.label_tolerance_us} us of a frame in "
                f"{self.recording.folder}, got {labels.matched} of {labels.label_times} label "
                "times that are; put both on one clock, or set protocol.label_tolerance_us or "
                "protocol.least_matched_labels"
            )

    @cached_property
    def labels(self) -> MatchedLabels:
        """The label rows of each frame."""
        return self.protocol.match(self.recording.tracks, self.recording.frame_times_us)

    @cached_property
    def watched(self) -> NDArray[np.bool_]:
        """Whether events were recorded in at least half of each window, shape (windows,)."""
        start, stop = self.span_us or self.reader.extent_us or (0, 0)
        inside = np.clip(self.windows_us, start, stop)
        seen: NDArray[np.bool_] = 2 * (inside[:, 1] - inside[:, 0]) >= self.binning.window_us
        return seen

    def boxes(self, index: int) -> LabelledBoxes:
        """Boxes x1 y1 x2 y2 and classes at the end of one window."""
        rows = self.labels.at(index + 1)  # the first window ends at the second frame
        return self.protocol.select(rows, self.recording.height, self.recording.width)

    def counts(self, index: int, boxes: NDArray[np.float32]) -> bool:
        """Whether the frame at the end of a window, with these boxes, takes part.

        It does not where there were no events to see, and not as an empty one where a label time
        beside it belongs to no frame.
        """
        if not self.recording.has_labels or not self.watched[index]:
            return False
        empty = self.protocol.score_empty_frames and index + 1 not in self.labels.doubtful
        return len(boxes) > 0 or empty

    def labelled_windows(self) -> NDArray[np.int64]:
        """Indices of the windows whose frames take part, int64."""
        indices = [index for index in range(len(self)) if self.counts(index, self.boxes(index)[0])]
        return np.array(indices, np.int64)


def said_of(sources: Sequence[WindowSource]) -> list[str]:
    """What a detector will not see of these recordings as one would think, in sentences."""
    found = []
    times = sum(source.labels.label_times for source in sources)
    matched = sum(source.labels.matched for source in sources)
    farthest = max((source.labels.farthest_us for source in sources), default=0)
    if matched < times or farthest:
        found.append(
            f"{matched} of {times} label times belong to a frame, at most {farthest} us apart"
        )
    labelled = [source for source in sources if source.recording.has_labels]
    outside = [source for source in labelled if not source.watched.all()]
    if outside:
        windows = sum(len(source) for source in labelled)
        found.append(
            f"{sum(int((~source.watched).sum()) for source in outside)} of {windows} labelled "
            "windows lie outside the events' span and are left out, in "
            + ", ".join(dict.fromkeys(source.recording.name for source in outside))
        )
    notes = [
        note
        for source in sources
        if (
            note := seen_between_frames(source.recording.frame_times_us, source.binning.window_us)[
                1
            ]
        )
    ]
    if notes:
        found.append(f"in {len(notes)} of {len(sources)} recordings, as the first, {notes[0]}")
    return found


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
