"""The plain path is the same function as the fast one, or comparing their times means nothing."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from eqs.benchmarks import plain_rvt
from eqs.benchmarks.rvt import Job, event_tensors, histogram, labels_of, stored_window, training
from eqs.models import RVTDetector
from eqs.models.loss import detection_loss
from eqs.models.yolox_head import anchor_grid, decode_boxes

JOB = Job("training", size=(64, 96), steps=3, batch=2)


@pytest.fixture
def detector():
    torch.manual_seed(0)
    return RVTDetector("tiny", 3, partition_split_32=1, layer_scale_init=1.0)


def test_features_and_states_agree(detector):
    x = event_tensors(JOB)
    with torch.no_grad():
        expected, before = plain_rvt.sequence(detector, x.float())
        found, states = detector.backbone.forward_sequence(x)
        for first, second in zip(found, expected, strict=True):
            torch.testing.assert_close(first.flatten(0, 1), second, rtol=1e-4, atol=1e-5)
        again, _ = plain_rvt.sequence(detector, x.float(), before)
        more, _ = detector.backbone.forward_sequence(x, states)
        torch.testing.assert_close(more[-1].flatten(0, 1), again[-1], rtol=1e-4, atol=1e-5)


def test_losses_and_gradients_agree(detector):
    torch.manual_seed(1)
    anchors = anchor_grid(((8, 12), (4, 6), (2, 3)), (8, 16, 32), torch.device("cpu"))
    raw = torch.randn(JOB.frames, len(anchors), 8)
    raw[..., 2:4] = raw[..., 2:4] * 0.3 + 1
    labels = labels_of(JOB)
    results = []
    for plain in (True, False):
        given = raw.clone().requires_grad_()
        boxes = decode_boxes(given, anchors)
        if plain:
            loss = plain_rvt.head_loss(given, anchors, labels)
        else:
            loss = detection_loss(boxes, given[..., 4:], anchors, labels)["loss"]
        results.append((loss, *torch.autograd.grad(loss, given)))
    torch.testing.assert_close(results[0], results[1], rtol=1e-4, atol=1e-5)


def test_histograms_agree():
    job = Job("histogram", size=(24, 32))
    fast = histogram(job)()
    plain = histogram(Job("histogram", plain=True, size=(24, 32)))()
    # The published bins divide the time between first and last event, in float32: a few differ.
    assert (torch.from_numpy(fast) != plain).float().mean() < 0.05


def test_stored_windows_agree(tmp_path):
    job = Job("stored window", size=(24, 32), folder=tmp_path)
    binned, stored = stored_window(replace(job, plain=True)), stored_window(job)
    for _ in range(2):  # made, then read
        np.testing.assert_array_equal(stored(), binned())


@pytest.mark.parametrize("plain", [True, False])
def test_a_training_step_reaches_every_parameter(plain, monkeypatch):
    made = []

    def remembered(*arguments, **options):
        made.append(RVTDetector(*arguments, **options))
        return made[-1]

    monkeypatch.setattr("eqs.benchmarks.rvt.RVTDetector", remembered)
    training(Job("training", plain=plain, size=(64, 96), steps=2, batch=1))()
    (detector,) = made
    assert [name for name, each in detector.named_parameters() if each.grad is None] == []
    assert all(each.grad.isfinite().all() for each in detector.parameters())
