"""Batches of a judge's training, cut from lessons of several sizes that lie in memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from eqs.training.sampling import keyed_generator

LEAST_SIDE_PX: Final = 4.0
LEAST_SHARE: Final = 0.35  # of a box that a cut leaves for it to count


class LessonTensors(NamedTuple):
    """A lesson as the network's device holds it.

    Args:
        histograms: uint8, shape (windows, channels, height, width).
        boxes: by window rows (class, left, top, right, bottom), float32.
    """

    histograms: Tensor
    boxes: list[NDArray[np.float32]]

    @classmethod
    def of(cls, histograms: NDArray[np.uint8], boxes: NDArray[np.float32]) -> LessonTensors:
        """From a lesson's arrays, `boxes` with the number of the window before each row."""
        by_window = [boxes[boxes[:, 0] == index, 1:] for index in range(len(histograms))]
        return cls(torch.from_numpy(histograms), by_window)


@dataclass(frozen=True, kw_only=True)
class Canvas:
    """The size of a batch: rows, columns, and how many samples it has."""

    height: int
    width: int
    samples: int


class LessonBatch(NamedTuple):
    """What a training step looks at.

    Args:
        histograms: uint8, shape (windows, samples, channels, height, width).
        labels: of the labelled frames, window by window, rows (class, centre x, centre y, width,
            height) with zero rows as padding, float32, shape (frames, rows, 5).
        labelled: which frames those are, bool, shape (windows, samples).
    """

    histograms: Tensor
    labels: Tensor
    labelled: Tensor


@dataclass(frozen=True)
class LessonBatches:
    """Batches by their number.

    A lesson larger than the canvas is cut at random, a smaller one is padded right and below, as
    the network pads. Every other sample is mirrored.

    Args:
        lessons: what is learnt from.
        canvases: sizes of the batches; one after the other, each for a whole epoch.
        steps_per_epoch: batches of an epoch.
        windows: windows of a sample, from a state of nothing.
        labelled: how many of these are labelled: the last one, and every other one before.
        seed: what all draws depend on.
    """

    lessons: Sequence[LessonTensors]
    canvases: Sequence[Canvas]
    steps_per_epoch: int
    windows: int
    labelled: int
    seed: int

    def batch(self, step: int) -> LessonBatch:
        """The batch of a step."""
        canvas = self.canvases[step // self.steps_per_epoch % len(self.canvases)]
        rng = keyed_generator(self.seed, "lessons", step)
        samples = [self._sample(rng, canvas) for _ in range(canvas.samples)]
        counted = torch.zeros(self.windows, canvas.samples, dtype=torch.bool)
        counted[self.windows - 1 - 2 * np.arange(self.labelled)] = True
        rows = [boxes[w] for w in range(self.windows) if counted[w, 0] for _, boxes in samples]
        return LessonBatch(
            histograms=torch.stack([histograms for histograms, _ in samples], dim=1),
            labels=padded(rows),
            labelled=counted,
        )

    def _sample(
        self, rng: np.random.Generator, canvas: Canvas
    ) -> tuple[Tensor, list[NDArray[np.float32]]]:
        lesson = self.lessons[int(rng.integers(len(self.lessons)))]
        length, _, height, width = lesson.histograms.shape
        first = int(rng.integers(length - self.windows + 1))
        top = int(rng.integers(max(0, height - canvas.height) + 1))
        left = int(rng.integers(max(0, width - canvas.width) + 1))
        rows, columns = slice(top, top + canvas.height), slice(left, left + canvas.width)
        cut = lesson.histograms[first : first + self.windows, :, rows, columns]
        shown_height, shown_width = cut.shape[-2:]
        mirrored = bool(rng.random() < 0.5)
        cut = cut.flip(-1) if mirrored else cut
        cut = functional.pad(cut, (0, canvas.width - shown_width, 0, canvas.height - shown_height))
        offset = np.array([left, top, left, top], np.float32)
        size = shown_width, shown_height
        boxes = lesson.boxes[first : first + self.windows]
        return cut, [seen_boxes(each, offset, size, mirrored=mirrored) for each in boxes]


def seen_boxes(
    boxes: NDArray[np.float32],
    offset: NDArray[np.float32],
    size: tuple[int, int],
    *,
    mirrored: bool,
) -> NDArray[np.float32]:
    """Detector rows of the boxes that a cut still shows.

    Args:
        boxes: rows (class, left, top, right, bottom).
        offset: left, top, left and top of the cut.
        size: width and height of the cut.
        mirrored: whether it is then mirrored.

    Returns:
        Rows (class, centre x, centre y, width, height).

    Example:
        >>> boxes = np.array([[2, 10, 4, 20, 12]], np.float32)
        >>> seen_boxes(boxes, np.array([4, 0, 4, 0]), (32, 32), mirrored=True).tolist()
        [[2.0, 21.0, 8.0, 10.0, 8.0]]
    """
    width, height = size
    corners = boxes[:, 1:] - offset
    clipped = np.clip(corners, 0, np.array([width, height, width, height]))
    sides = clipped[:, 2:] - clipped[:, :2]
    whole = np.maximum(np.prod(corners[:, 2:] - corners[:, :2], axis=1), 1e-6)
    kept = (sides >= LEAST_SIDE_PX).all(axis=1) & (sides.prod(axis=1) / whole >= LEAST_SHARE)
    centres = (clipped[:, :2] + clipped[:, 2:]) / 2
    if mirrored:
        centres[:, 0] = width - centres[:, 0]
    rows: NDArray[np.float32] = np.concatenate(
        [boxes[:, :1], centres, sides], axis=1, dtype=np.float32
    )
    shown: NDArray[np.float32] = rows[kept]
    return shown


def padded(rows: Sequence[NDArray[np.float32]]) -> Tensor:
    """Label rows of several frames as one tensor, with zero rows as padding."""
    most = max(1, max(len(each) for each in rows))
    filled = np.zeros((len(rows), most, 5), np.float32)
    for frame, each in zip(filled, rows, strict=True):
        frame[: len(each)] = each
    return torch.from_numpy(filled)


def moved_to(lessons: Sequence[LessonTensors], device: Any) -> list[LessonTensors]:  # noqa: ANN401
    """The lessons with their histograms on a device."""
    return [each._replace(histograms=each.histograms.to(device)) for each in lessons]
