"""Batches that are cut from lessons of several sizes."""

from __future__ import annotations

import numpy as np
import torch

from eqs.training.lesson_batches import Canvas, LessonBatches, LessonTensors, padded, seen_boxes


def lesson(height: int, width: int, windows: int = 8) -> LessonTensors:
    """Counts that tell the window and the place; a box in every window."""
    rows, columns = np.mgrid[:height, :width]
    counts = (rows + 2 * columns) % 200
    histograms = np.stack([np.stack([counts + k] * 4) for k in range(windows)]).astype(np.uint8)
    boxes = [(k, 1, 2, 3, 14, 15) for k in range(windows)]
    return LessonTensors.of(histograms, np.array(boxes, np.float32))


BATCHES = LessonBatches(
    lessons=[lesson(32, 48), lesson(16, 20)],
    canvases=[Canvas(height=24, width=32, samples=3), Canvas(height=16, width=16, samples=2)],
    steps_per_epoch=2,
    windows=5,
    labelled=2,
    seed=3,
)


def test_a_batch_depends_on_its_number_alone() -> None:
    first, again, other = (BATCHES.batch(step) for step in (0, 0, 1))
    assert torch.equal(first.histograms, again.histograms)
    assert torch.equal(first.labels, again.labels)
    assert not torch.equal(first.histograms, other.histograms)


def test_canvases_follow_each_other_by_epoch() -> None:
    shapes = [tuple(BATCHES.batch(step).histograms.shape) for step in range(5)]
    assert shapes[0] == shapes[1] == shapes[4] == (5, 3, 4, 24, 32)
    assert shapes[2] == shapes[3] == (5, 2, 4, 16, 16)


def test_the_last_frame_and_every_other_one_before_is_labelled() -> None:
    batch = BATCHES.batch(0)
    assert batch.labelled.any(dim=1).tolist() == [False, False, True, False, True]
    assert len(batch.labels) == int(batch.labelled.sum())


def test_windows_stay_in_order_and_boxes_on_their_things() -> None:
    for step in range(8):
        batch = BATCHES.batch(step)
        steps = batch.histograms[1:, :, 0, 0, 0].int() - batch.histograms[:-1, :, 0, 0, 0].int()
        assert (steps == 1).all()
        height, width = batch.histograms.shape[-2:]
        for rows in batch.labels:
            for _, x, y, w, h in rows[rows[:, 3] > 0].tolist():
                assert 0 <= x - w / 2 < x + w / 2 <= width
                assert 0 <= y - h / 2 < y + h / 2 <= height


def test_a_small_lesson_is_padded_right_and_below() -> None:
    small = LessonBatches(
        lessons=[lesson(16, 20)], canvases=[Canvas(height=24, width=32, samples=2)],
        steps_per_epoch=1, windows=2, labelled=1, seed=0,
    )  # fmt: skip
    for step in range(4):
        histograms = small.batch(step).histograms
        assert not histograms[..., 16:, :].any()
        assert not histograms[..., 20:].any()


def test_boxes_are_cut_mirrored_and_left_out() -> None:
    boxes = np.array([[2, 10, 4, 20, 12], [1, -30, 0, 6, 10], [0, 28, 0, 31, 9]], np.float32)
    offset = np.zeros(4, np.float32)
    plain = seen_boxes(boxes, offset, (32, 32), mirrored=False)
    assert plain.tolist() == [[2, 15, 8, 10, 8]]  # one lies outside by most, one is too narrow
    mirrored = seen_boxes(boxes, offset, (32, 32), mirrored=True)
    assert mirrored.tolist() == [[2, 17, 8, 10, 8]]


def test_frames_without_boxes_are_rows_of_nothing() -> None:
    rows = padded([np.zeros((0, 5), np.float32), np.ones((2, 5), np.float32)])
    assert rows.shape == (2, 2, 5)
    assert not rows[0].any()
    assert padded([np.zeros((0, 5), np.float32)]).shape == (1, 1, 5)
