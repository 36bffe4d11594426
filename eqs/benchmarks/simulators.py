"""Time the simulators, on a clip drawn here or on images at 20 Hz.

Each simulator runs in a process of its own, once on a corner of the clip to compile, then on the
whole; the fastest run counts. Frames are in memory before, events are complete and in order of time
after.
"""

from __future__ import annotations

import atexit
import shutil
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console
from rich.table import Table

from eqs import simulators
from eqs.benchmarks.timing import Cost, in_own_process, time_runs
from eqs.frames import FrameFolder, GreyImage, Light, image_paths
from eqs.models.volumes import VolumeGenerator
from eqs.simulators.learned import FOLDS

NAMES = tuple(
    name
    for name, kind in vars(simulators).items()
    if isinstance(kind, type)
    and issubclass(kind, simulators.Simulator)
    and "name" in vars(kind)
    and kind is not simulators.VolumeNetwork  # whose network is the user's
)
THRESHOLDS_LOG = (0.2, 0.02)
CONTRAST = {"threshold_on_log", "threshold_off_log", "threshold_log"}
PERIOD_US = 50_000


def draw_clip(frames: int, height: int, width: int, seed: int = 0) -> np.ndarray:
    """A texture with structure at all sizes that drifts by three pixels a frame, uint8."""
    generator = np.random.default_rng(seed)
    spectrum = np.fft.rfft2(generator.standard_normal((height, 2 * width)))
    rate = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(2 * width)[None])
    rate[0, 0] = 1.0
    spectrum /= rate**1.1
    clip = np.empty((frames, height, width), np.uint8)
    drift = np.exp(-2j * np.pi * np.fft.rfftfreq(2 * width) * 3.0)
    low = high = None
    for index in range(frames):
        picture = np.fft.irfft2(spectrum * drift**index, s=(height, 2 * width))[:, :width]
        if low is None or high is None:
            low, high = picture.min(), picture.max()
        clip[index] = np.clip(30.0 + 200.0 * (picture - low) / (high - low), 0, 255)
    return clip


def has_threshold(name: str) -> bool:
    """Whether the simulator has a contrast threshold to set; other models have other parameters."""
    return bool(CONTRAST & {field.name for field in fields(getattr(simulators, name))})


def configured(name: str, threshold_log: float) -> Any:  # noqa: ANN401 - one of many classes
    """The simulator with all its mean thresholds at one value, if it has such, else as it is."""
    kind = getattr(simulators, name)
    if kind is simulators.EventGAN:
        return kind(network=random_networks())
    names = {field.name for field in fields(kind)}
    values = dict.fromkeys(CONTRAST & names, threshold_log)
    if "threshold_min_log" in names:
        values["threshold_min_log"] = threshold_log
    return kind(**values)


def random_networks() -> simulators.Learning:
    """Networks that learned nothing, which takes as long to ask; they go with this process."""
    root = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, root, ignore_errors=True)
    learning = simulators.Learning(teacher=Untaught(), root=root)
    for fold in range(FOLDS):
        torch.manual_seed(fold)
        learning.keep(fold, VolumeGenerator(learning.width).state_dict())
    learning.finish({"teacher": learning.taught_by.name, "folds": [[], []], "val": []})
    return learning


@dataclass(frozen=True)
class Untaught:
    """No data set."""

    name: str = "nothing"
    sensor_hash: str | None = None


@dataclass(frozen=True)
class Job:
    """One line of the table.

    Args:
        name: class of the simulator.
        threshold_log: its mean thresholds, where it has such.
        frames: how many frames at 20 Hz.
        size: rows and columns of a clip drawn here.
        folder: images to take the frames from instead.
    """

    name: str
    threshold_log: float
    frames: int
    size: tuple[int, int]
    folder: Path | None = None

    def clip(self) -> np.ndarray:
        """The frames.

        Raises:
            FileNotFoundError: the folder holds no image.
            ValueError: the images differ in size or cannot be read.
        """
        if self.folder is None:
            return draw_clip(self.frames, *self.size)
        times_us = PERIOD_US * np.arange(len(image_paths(self.folder)))
        return FrameFolder(self.folder, times_us).read(0, self.frames)


def measure(job: Job) -> tuple[int, int, Cost]:
    """Numbers of frames and events, and what a run costs beyond clip and program."""
    simulator, clip = configured(job.name, job.threshold_log), job.clip()
    times_us = PERIOD_US * np.arange(len(clip))
    run(simulator, clip[:4, :32, :32], times_us[:4])
    counts: list[int] = []
    cost = time_runs(lambda: counts.append(run(simulator, clip, times_us)))
    return len(clip), counts[0], cost


def run(simulator: simulators.Simulator, clip: np.ndarray, times_us: np.ndarray) -> int:
    """Number of events of a clip, simulated in chunks as a study does."""
    stream = simulator.start("benchmark")
    chunks = range(0, len(clip), 8)
    count = sum(len(stream.step(clip[k : k + 8], times_us[k : k + 8])) for k in chunks)
    return count + len(stream.finish())


def print_table(
    frames: int,
    width: int,
    height: int,
    names: Sequence[str] = NAMES,
    folder: Path | None = None,
) -> None:
    """One row per simulator and threshold."""
    drawn = f"{frames} frames of {width}x{height}"
    table = Table(title=drawn if folder is None else f"{folder.name}, up to {frames} frames")
    for column in ("simulator", "threshold", "Mevents", "Mevents/s", "frames/s", "peak MiB"):
        table.add_column(column, justify="left" if column == "simulator" else "right")
    for name in names:
        for threshold_log in THRESHOLDS_LOG[: None if has_threshold(name) else 1]:
            job = Job(name, threshold_log, frames, (height, width), folder)
            length, events, cost = in_own_process(measure, job)
            rates = (events / 1e6 / cost.seconds, length / cost.seconds)
            shown = str(threshold_log) if has_threshold(name) else "its own"
            values = (events / 1e6, *rates, cost.peak_mib)
            table.add_row(name, shown, *(f"{value:.1f}" for value in values))
    console = Console()
    console.print(table)
    plain, linear = light_milliseconds(draw_clip(2, height, width)[0])
    console.print(
        f"an image takes {plain:.3f} ms of a core, of display values, and {linear:.3f} ms with "
        "light=srgb, medians"
    )


def light_milliseconds(frame: np.ndarray, repeats: int = 51) -> tuple[float, float]:
    """What a frame costs until pixels see it, as display values and as light, in turn."""
    seconds: dict[str, list[float]] = {"plain": [], "linear": []}
    for _ in range(repeats):
        for name, seen in (("plain", GreyImage.from_frame), ("linear", Light().image)):
            start = time.process_time()
            for _ in range(10):
                seen(frame)
            seconds[name].append((time.process_time() - start) / 10)
    plain, linear = (1000 * float(np.median(each)) for each in seconds.values())
    return plain, linear
