"""Time the detector's fast path against the same function computed plainly, in one run."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from torch import Tensor

from eqs.benchmarks import plain_rvt
from eqs.benchmarks.simulators import PERIOD_US, draw_clip
from eqs.benchmarks.timing import Cost, in_own_process, time_runs
from eqs.events import EventReader, Events
from eqs.models import RVTDetector
from eqs.models.loss import detection_loss
from eqs.models.yolox_head import decode_boxes
from eqs.representations import stacked_histogram
from eqs.simulators import ESIM
from eqs.training.histogram_cache import cached_histogram

CLASSES: Final = 3
OBJECTS: Final = 8  # rows of labels per frame, half of them padding
STEPS: Final = 5
EVENTS: Final = 2_000_000
ROUNDS: Final = 2


@dataclass(frozen=True)
class Job:
    """One line of the table, computed one of the two ways.

    Args:
        what: inference, training, loss, histogram or stored window.
        plain: one time step after the other instead of the fast path.
        size: rows and columns.
        steps: time steps of one run.
        batch: samples side by side.
        half: compute in bfloat16 where autocast does.
        folder: where a job that needs files may put them.
    """

    what: str
    plain: bool = False
    size: tuple[int, int] = (256, 320)
    steps: int = 1
    batch: int = 1
    half: bool = False
    folder: Path = Path()

    @property
    def frames(self) -> int:
        """Frames of one run."""
        return self.steps * self.batch


LINES: Final = (
    Job("inference", steps=1),
    Job("inference", steps=10),
    Job("inference", steps=1, size=(512, 640)),
    *(
        Job("training", steps=STEPS, batch=batch, half=half)
        for half in (False, True)
        for batch in (1, 4, 8)
    ),
    Job("loss", steps=STEPS, batch=8),
    Job("histogram", size=(480, 640)),
    Job("stored window", size=(480, 640)),
)


def measure(job: Job) -> Cost:
    """What one run of `job` costs, once everything is set up."""
    torch.manual_seed(0)
    with tempfile.TemporaryDirectory() as folder:
        return time_runs(SET_UP[job.what](replace(job, folder=Path(folder))))


def event_tensors(job: Job) -> Tensor:
    """Sparse counts (T, N, 20, H, W) like those of a driving camera."""
    shape = (job.steps, job.batch, 20, *job.size)
    return torch.poisson(torch.full(shape, 0.1)).clamp(max=10).to(torch.uint8)


def labels_of(job: Job) -> Tensor:
    """Labels (F, M, 5) of objects that lie inside the image."""
    labels = torch.rand(job.frames, OBJECTS, 5)
    labels[..., 0] = (labels[..., 0] * CLASSES).floor()
    labels[..., 1] *= job.size[1]
    labels[..., 2] *= job.size[0]
    labels[..., 3:] = 12 + 60 * labels[..., 3:]
    labels[:, OBJECTS // 2 :] = 0
    return labels


def inference(job: Job) -> Callable[[], object]:
    """Detect in the next `steps` frames of a stream."""
    detector = RVTDetector("small", CLASSES, partition_split_32=1).eval()
    x = event_tensors(job)
    states = None

    @torch.inference_mode()
    def run() -> object:
        nonlocal states
        if job.plain:
            found = []
            for step in x.float():
                features, states = plain_rvt.sequence(detector, step[None], states)
                found.append(detector.detect(features))
            return found
        maps, states = detector.backbone.forward_sequence(x, states)
        return detector.detect([level.flatten(0, 1) for level in maps])

    return run


def training(job: Job) -> Callable[[], object]:
    """One training step: forward, loss, backward; optimizers are the same either way."""
    detector = RVTDetector("small", CLASSES, partition_split_32=1).train()
    x, labels = event_tensors(job), labels_of(job)

    def run() -> None:
        with torch.autocast("cpu", torch.bfloat16, enabled=job.half):
            if job.plain:
                features, _ = plain_rvt.sequence(detector, x.float())
                loss = plain_rvt.loss(detector, features, labels)
            else:
                maps, _ = detector.backbone.forward_sequence(x)
                loss = detector.loss([level.flatten(0, 1) for level in maps], labels)["loss"]
        detector.zero_grad()
        loss.backward()

    return run


def loss(job: Job) -> Callable[[], object]:
    """Assignment and loss of frames whose head outputs are there already."""
    detector = RVTDetector("small", CLASSES, partition_split_32=1).eval()
    with torch.no_grad():
        maps, _ = detector.backbone.forward_sequence(event_tensors(job))
        levels = detector.fpn([level.flatten(0, 1) for level in maps][-3:])
        raw, anchors = detector.yolox_head(levels)
    raw, labels = raw.requires_grad_(), labels_of(job)

    def run() -> None:
        if job.plain:
            total = plain_rvt.head_loss(raw, anchors, labels)
        else:
            boxes = decode_boxes(raw, anchors)
            total = detection_loss(boxes, raw[..., 4:], anchors, labels)["loss"]
        total.backward()

    return run


def histogram(job: Job) -> Callable[[], object]:
    """Bin a window of events at random addresses."""
    rng, (height, width) = np.random.default_rng(0), job.size
    t = np.sort(rng.integers(0, 50_000, EVENTS))
    x, y = rng.integers(0, width, EVENTS), rng.integers(0, height, EVENTS)
    p = rng.integers(0, 2, EVENTS)
    events = Events.from_arrays(t=t, x=x, y=y, p=p, height=height, width=width)
    if job.plain:
        columns = [torch.from_numpy(column) for column in (t, x, y, p)]
        return lambda: plain_rvt.histogram(columns, 10, height, width)
    return lambda: stacked_histogram(events, 10, 0, 50_000)


def stored_window(job: Job) -> Callable[[], object]:
    """A window of a drifting picture from disk: its events to be binned, or its histogram."""
    clip, times_us = draw_clip(3, *job.size), PERIOD_US * np.arange(3)
    events = ESIM(threshold_on_log=0.03, threshold_off_log=0.03).simulate(clip, times_us)
    events.save(job.folder / "events.h5")
    reader = EventReader(job.folder / "events.h5")

    def binned() -> NDArray[np.uint8]:
        return stacked_histogram(reader.window(0, PERIOD_US), 10, 0, PERIOD_US)

    shape = binned().shape

    def stored() -> NDArray[np.uint8]:
        return cached_histogram(job.folder / "0.h5", binned, shape)

    return binned if job.plain else stored


SET_UP: Final = {
    "inference": inference,
    "training": training,
    "loss": loss,
    "histogram": histogram,
    "stored window": stored_window,
}


def best(job: Job) -> tuple[Cost, Cost]:
    """Costs of the plain and of the fast way, taken in turns: a noisy spell hits both."""
    plain, fast = [], []
    for _ in range(ROUNDS):
        plain.append(in_own_process(measure, replace(job, plain=True)))
        fast.append(in_own_process(measure, job))
    return min(plain), min(fast)


def print_table() -> None:
    """One row per line: time per frame, memory, ratio."""
    table = Table(title=f"RVT-small, {torch.get_num_threads()} threads: plain against fast path")
    columns = ("what", "size", "T x N", "type", "plain", "fast", "ratio", "plain MiB", "fast MiB")
    for column in columns:
        table.add_column(column, justify="right")
    for job in LINES:
        plain, fast = best(job)
        table.add_row(*row(job, plain, fast))
    Console(width=max(Console().width, 110)).print(table)


def row(job: Job, plain: Cost, fast: Cost) -> list[str]:
    """Cells of one line; the histogram counts events, everything else frames."""
    if job.what == "histogram":
        times = [f"{EVENTS / cost.seconds / 1e6:.0f} Mev/s" for cost in (plain, fast)]
    else:
        times = [f"{1e3 * cost.seconds / job.frames:.1f} ms/frame" for cost in (plain, fast)]
    return [
        job.what,
        f"{job.size[1]}x{job.size[0]}",
        f"{job.steps} x {job.batch}",
        "bfloat16" if job.half else "float32",
        *times,
        f"{plain.seconds / fast.seconds:.2f}",
        *(f"{cost.peak_mib:.0f}" for cost in (plain, fast)),
    ]
