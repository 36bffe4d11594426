"""Compare frames made in between with rendered ones, and the events of both.

Of a rendered street at 400 Hz the frames of `dsec_mini`'s camera are kept, one in 50 ms; the
nineteen between are made again and compared with those that were there, and ESIM fires on both.
Frames show one instant in eight bits, without exposure and noise, so that nothing but the making
differs. Times are those of one thread.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from eqs.benchmarks.timing import in_own_process
from eqs.events import Events
from eqs.frames import FlowInterpolation, Interpolation, LinearInterpolation, NetworkInterpolation
from eqs.scenes import DrivingWorld, FrameCamera
from eqs.scenes.camera import tone_curve
from eqs.simulators import ESIM

PERIOD_US: Final = 2500
FACTOR: Final = 20
BIN_US: Final = 5000
PAIRS: Final = 10
START_US: Final = 60_000
WORLD: Final = 77  # names the streets, which are none of dsec_mini's


class Measured(NamedTuple):
    """What one way of making frames is worth, the mean over worlds.

    Args:
        psnr_db: of the frames made, against the rendered ones; NaN where none are made.
        cosine: of the events' counts per pixel, polarity and 5 ms with the rendered frames'.
        events: events per event of the rendered frames.
        cpu_ms: milliseconds of one thread a frame made.
    """

    psnr_db: float
    cosine: float
    events: float
    cpu_ms: float


@dataclass(frozen=True)
class Job:
    """One line of the table.

    Args:
        interpolation: makes the frames, nineteen between two; None for none.
        size: rows and columns.
        worlds: how many streets.
        pairs: how many intervals of each.
    """

    interpolation: Interpolation | None
    size: tuple[int, int]
    worlds: int
    pairs: int = PAIRS


def measure(job: Job) -> Measured:
    """The mean over the worlds."""
    use_one_thread()
    found = [measured_in(world, job) for world in range(job.worlds)]
    return Measured(*(float(np.mean(values)) for values in zip(*found, strict=True)))


def measured_in(world: int, job: Job) -> Measured:
    """What the frames made are worth in one world."""
    frames, times_us = rendered(world, job.size, job.pairs)
    truth = ESIM().simulate(frames, times_us)
    events = ESIM(interpolation=job.interpolation).simulate(frames[::FACTOR], times_us[::FACTOR])
    counts = cosine(events, truth), len(events) / len(truth)
    if job.interpolation is None:
        return Measured(float("nan"), *counts, 0.0)
    job.interpolation.between(frames[0], frames[FACTOR])  # loads and compiles
    errors, seconds = [], 0.0
    for first in range(0, len(frames) - 1, FACTOR):
        start = time.process_time()
        made = job.interpolation.between(frames[first], frames[first + FACTOR])
        seconds += time.process_time() - start
        errors.append(np.mean((made - frames[first + 1 : first + FACTOR]) ** 2))
    psnr_db = 10 * np.log10(255**2 / np.mean(errors))
    return Measured(float(psnr_db), *counts, 1e3 * seconds / (job.pairs * (FACTOR - 1)))


@cache
def rendered(
    world: int, size: tuple[int, int], pairs: int
) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """Frames at 400 Hz of a street by day, as a camera shows them, and their times."""
    height, width = size
    times_us = START_US + PERIOD_US * np.arange(FACTOR * pairs + 1, dtype=np.int64)
    duration_s = 1e-6 * float(times_us[-1])
    street = DrivingWorld(height=height, width=width, seed=(WORLD, world), duration_s=duration_s)
    white_lux = FrameCamera().meter(street.radiance(float(times_us[len(times_us) // 2]))).white_lux
    light = (street.radiance(float(t)) / white_lux for t in times_us)
    frames = np.stack([np.rint(255 * tone_curve(each)).astype(np.uint8) for each in light])
    return frames, times_us


def cosine(events: Events, truth: Events) -> float:
    """Of the counts per pixel, polarity and 5 ms of two streams, bin by bin to save memory."""
    sums = np.zeros(3)
    edges = range(START_US, int(max(events.t.max(), truth.t.max())) + 1, BIN_US)
    for start in edges:
        a, b = (counts(stream, start, start + BIN_US) for stream in (events, truth))
        sums += a @ b, a @ a, b @ b
    return float(sums[0] / np.sqrt(sums[1] * sums[2]))


def counts(events: Events, start_us: int, stop_us: int) -> NDArray[np.float64]:
    """Events per polarity and pixel in a window."""
    low, high = np.searchsorted(events.t, [start_us, stop_us])
    place = events.y[low:high].astype(np.int64) * events.width + events.x[low:high]
    pixels = events.height * events.width
    found = np.bincount(place + pixels * events.p[low:high].astype(np.int64), minlength=2 * pixels)
    return found.astype(np.float64)


def use_one_thread() -> None:
    """What is measured is work, not cores."""
    import cv2
    import torch

    cv2.setNumThreads(1)
    torch.set_num_threads(1)


def methods(networks: Sequence[Path]) -> dict[str, Interpolation | None]:
    """The ways that are compared."""
    made: dict[str, Any] = {
        "none": None,
        "linear": LinearInterpolation(factor=FACTOR),
        "flow": FlowInterpolation(factor=FACTOR),
    }
    return made | {p.name: NetworkInterpolation(network=p, factor=FACTOR) for p in networks}


def print_table(worlds: int, width: int, height: int, networks: Sequence[Path]) -> None:
    """One row per way of making frames."""
    found = [path for path in networks if path.is_file()]
    table = Table(title=f"{worlds} streets of {width}x{height}, {PAIRS} intervals each")
    for column in ("", "PSNR dB", "cosine", "events per event", "CPU ms a frame"):
        table.add_column(column, justify="right" if column else "left")
    for name, interpolation in methods(found).items():
        line = in_own_process(measure, Job(interpolation, (height, width), worlds))
        psnr = "-" if interpolation is None else f"{line.psnr_db:.1f}"
        numbers = f"{line.cosine:.3f}", f"{line.events:.2f}", f"{line.cpu_ms:.1f}"
        table.add_row(name, psnr, *numbers)
    Console().print(table)
    for path in networks:
        if path not in found:
            Console().print(f"no file at {path}; eqs fetch-interpolator rife makes RIFE's")
