"""Time how fast windows come to a training, and see that memory does not grow with the recording.

The recording is drawn here: events everywhere at random, half a million in each window, which is
what DSEC's camera gives on a street and the hardest to pack.
"""

from __future__ import annotations

import os
import tempfile
import time
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from eqs.benchmarks.timing import in_own_process, peak_mib
from eqs.data import LabelProtocol, Recording
from eqs.events import EventReader, Events, EventWriter
from eqs.representations import stacked_histogram
from eqs.training import EventDataModule

WINDOW_US = 50_000
PER_WINDOW = 500_000
WORKERS = (0, 2, 4)
SEQUENCE, BATCH = 5, 2
BATCHES = 100  # that are timed, after a first one
BOX = [("t", np.int64), *((name, np.float32) for name in "xywh"), ("class_id", np.int64)]
MEASURED_WINDOWS = 120  # a training draws from so many; more only take longer to draw


@dataclass(frozen=True, kw_only=True)
class Job:
    """One line of the table.

    Args:
        events: file of the events.
        size: width and height.
        windows: windows of the recording.
        cache: folder of histograms that are binned already; None to bin them.
        workers: processes that read beside the training.
    """

    events: Path
    size: tuple[int, int]
    windows: int
    cache: Path | None
    workers: int


def draw(path: Path, windows: int, width: int, height: int) -> None:
    """Write a recording, window by window."""
    generator = np.random.default_rng(0)
    with EventWriter(path, height, width, t_offset_us=0) as writer:
        for window in track(range(windows), description="drawing events", transient=True):
            start = window * WINDOW_US
            events = Events.from_arrays(
                t=np.sort(generator.integers(start, start + WINDOW_US, PER_WINDOW)),
                x=generator.integers(0, width, PER_WINDOW),
                y=generator.integers(0, height, PER_WINDOW),
                p=generator.integers(0, 2, PER_WINDOW),
                height=height,
                width=width,
            )
            writer.append(events)


class OneRecording:
    """A data set of one recording, every frame of it labelled with one box."""

    def __init__(self, job: Job) -> None:
        """Lay out frame times and boxes."""
        times_us = WINDOW_US * np.arange(job.windows + 1, dtype=np.int64)
        tracks = np.array([(time, 10, 10, 50, 50, 0) for time in times_us], BOX)
        width, height = job.size
        self.recording = Recording(
            name="drawn",
            folder=job.events.parent,
            height=height,
            width=width,
            frame_times_us=times_us,
            events_path=job.events,
            tracks=tracks,
        )

    def recordings(self, split: str) -> list[Recording]:
        """The recording, whatever the split."""
        return [self.recording]

    def path(self, recording: Recording) -> Path:
        """The recording's own events."""
        return recording.events_path


def windows_per_second(job: Job) -> float:
    """How many windows a training gets in a second, after the first batch."""
    data = OneRecording(job)
    module = EventDataModule(
        data,
        LabelProtocol(name="drawn", classes={"box": [0]}),
        source=data,
        tests={"real": data},
        batch_size=BATCH,
        sequence_length=SEQUENCE,
        steps_per_epoch=1 + BATCHES,
        epochs=1,
        histogram_cache=job.cache,
        num_workers=job.workers,
    )
    with warnings.catch_warnings():
        warnings.filterwarnings(
            "ignore", "This DataLoader will create"
        )  # more than there are cores
        batches = iter(module.train_dataloader())
    next(batches)
    begun = time.perf_counter()
    for _ in batches:  # to the end, so that no process is stopped at its work
        pass
    return BATCHES * BATCH * SEQUENCE / (time.perf_counter() - begun)


def fill(job: Job) -> None:
    """Bin every window, so that the cache holds all of them."""
    module = EventDataModule(
        data := OneRecording(job),
        LabelProtocol(name="drawn", classes={"box": [0]}),
        source=data,
        tests={"real": data},
        histogram_cache=job.cache,
    )
    (source,) = module.sources("train", data)
    for index in range(len(source)):
        source.histogram(index)


def streamed(job: Job) -> tuple[float, float, float]:
    """Read and bin every window once: windows a second, MiB after a tenth, and MiB at the end."""
    width, height = job.size
    begun, early = time.perf_counter(), 0.0
    with EventReader(job.events, height, width) as reader:
        for index in range(job.windows):
            start = index * WINDOW_US
            events = reader.window(start, start + WINDOW_US)
            stacked_histogram(events, bins=10, start_us=start, stop_us=start + WINDOW_US)
            if index == job.windows // 10:
                early = peak_mib()
    return job.windows / (time.perf_counter() - begun), early, peak_mib()


def print_table(events: int, width: int, height: int) -> None:
    """Print both tables.

    Raises:
        ValueError: the recording would have no window.
    """
    windows = events // PER_WINDOW
    if windows < SEQUENCE:
        raise ValueError(
            f"Expected at least {SEQUENCE * PER_WINDOW} events, {PER_WINDOW} a window, got {events}"
            "; set --events"
        )
    console = Console()
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "events.h5"
        draw(path, windows, width, height)
        size = width, height
        few = min(windows, MEASURED_WINDOWS)
        plain = Job(events=path, size=size, windows=few, cache=None, workers=0)
        cached = Job(events=path, size=size, windows=few, cache=Path(place) / "kept", workers=0)
        table = Table(
            title=f"windows a second for a training, {width}x{height}, {PER_WINDOW:,} events each, "
            f"{cores} cores",
            title_justify="left",
        )
        for column in ("processes beside", "binned on the fly", "read from the cache"):
            table.add_column(column, justify="right")
        in_own_process(fill, cached)
        for workers in WORKERS:
            jobs = [replace(job, workers=workers) for job in (plain, cached)]
            rates = [in_own_process(windows_per_second, job) for job in jobs]
            table.add_row(str(workers), *(f"{rate:.1f}" for rate in rates))
        console.print(table)
        whole = Job(events=path, size=size, windows=windows, cache=None, workers=0)
        rate, early, late = in_own_process(streamed, whole)
        console.print(
            f"{windows * PER_WINDOW / 1e6:.0f} M events ({path.stat().st_size / 2**30:.2f} GiB) "
            f"streamed at {rate:.1f} windows or {rate * PER_WINDOW / 1e6:.0f} M events a second: "
            f"peak memory {early:.0f} MiB after a tenth, {late:.0f} MiB at the end",
            highlight=False,
        )
