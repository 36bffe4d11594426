"""SimOTA and the loss against a plain implementation, object by object."""

import math

import pytest
import torch

from eqs.models import detection_loss
from eqs.models.assignment import assign, pairwise_iou
from eqs.models.yolox_head import anchor_grid, decode_boxes

SHAPES = ((8, 10), (4, 5), (2, 3))
STRIDES = (8, 16, 32)


def iou_of(first, second):
    overlap = 1.0
    for axis in (0, 1):
        low = max(f[axis] - f[axis + 2] / 2 for f in (first, second))
        high = min(f[axis] + f[axis + 2] / 2 for f in (first, second))
        overlap *= max(high - low, 0.0)
    return overlap / (first[2] * first[3] + second[2] * second[3] - overlap)


def bce(probability, target):
    return -math.log(probability if target else 1 - probability)


def plain_assignment(boxes, logits, anchors, labels):
    """{anchor: (object, IoU)} of one frame, following the description step by step."""
    objects = [row for row in labels.tolist() if sum(row) > 0]

    def near(row, anchor):
        column, line, stride = anchor
        return (
            max(abs((column + 0.5) * stride - row[1]), abs((line + 0.5) * stride - row[2]))
            < 1.5 * stride
        )

    grid = anchors.tolist()
    candidates = [a for a in range(len(grid)) if any(near(row, grid[a]) for row in objects)]
    probability = logits.double().sigmoid().tolist()
    cost, iou, takers = {}, {}, {}
    for g, row in enumerate(objects):
        for a in candidates:
            iou[g, a] = iou_of(row[1:], boxes[a].tolist())
            objectness, *classes = probability[a]
            cost[g, a] = sum(
                bce(math.sqrt(p * objectness), k == row[0]) for k, p in enumerate(classes)
            )
            cost[g, a] += -3 * math.log(iou[g, a] + 1e-8) + 1e6 * (not near(row, grid[a]))
        best = sorted((iou[g, a] for a in candidates), reverse=True)[:10]
        for a in sorted(candidates, key=lambda a, g=g: cost[g, a])[: max(1, int(sum(best)))]:
            takers.setdefault(a, []).append(g)
    chosen = {
        a: gs[0] if len(gs) == 1 else min(range(len(objects)), key=lambda g, a=a: cost[g, a])
        for a, gs in takers.items()
    }
    return {a: (g, iou[g, a]) for a, g in chosen.items()}


def crowded_frames(frames=4, objects=9, classes=3, seed=0):
    generator = torch.Generator().manual_seed(seed)
    anchors = anchor_grid(SHAPES, STRIDES, torch.device("cpu"))
    raw = torch.randn(frames, len(anchors), 5 + classes, generator=generator)
    raw[..., 2:4] = raw[..., 2:4] * 0.3 + 1
    labels = torch.rand(frames, objects, 5, generator=generator)
    labels[..., 0] = (labels[..., 0] * classes).floor()
    labels[..., 1:3] *= torch.tensor([80.0, 64.0])
    labels[..., 3:] = 12 + 25 * labels[..., 3:]
    labels[1:2, 4:] = 0
    labels[2:3] = 0
    return raw, anchors, labels


@pytest.mark.parametrize("seed", range(3))
def test_assignment_follows_the_description(seed):
    raw, anchors, labels = crowded_frames(seed=seed)
    boxes = decode_boxes(raw, anchors)
    found = assign(boxes, raw[..., 4:], anchors, labels)
    for frame in range(len(labels)):
        expected = plain_assignment(boxes[frame], raw[frame, :, 4:], anchors, labels[frame])
        here = found.frame == frame
        anchor, row = found.anchor[here].tolist(), found.row[here].tolist()
        assert dict(zip(anchor, row, strict=True)) == {a: g for a, (g, _) in expected.items()}
        wanted = torch.tensor([expected[a][1] for a in anchor], dtype=torch.float32)
        torch.testing.assert_close(found.iou[here], wanted)
    assert not (found.frame == 2).any()


def test_frames_do_not_influence_each_other():
    raw, anchors, labels = crowded_frames()
    boxes = decode_boxes(raw, anchors)
    together = assign(boxes, raw[..., 4:], anchors, labels)
    alone = assign(boxes[:1], raw[:1, :, 4:], anchors, labels[:1])
    here = together.frame == 0
    assert torch.equal(together.anchor[here], alone.anchor)
    assert torch.equal(together.row[here], alone.row)


def test_padding_rows_may_stand_anywhere():
    raw, anchors, labels = crowded_frames()
    boxes = decode_boxes(raw, anchors)
    padded = torch.cat((torch.zeros(4, 2, 5), labels, torch.zeros(4, 3, 5)), dim=1)
    first = assign(boxes, raw[..., 4:], anchors, labels)
    second = assign(boxes, raw[..., 4:], anchors, padded)
    assert torch.equal(first.anchor, second.anchor)
    assert torch.equal(first.row + 2, second.row)


@pytest.mark.parametrize("shape", [(2, 0, 5), (2, 3, 5)])
def test_without_objects_only_confidence_is_trained(shape):
    raw, anchors, _ = crowded_frames(frames=2)
    raw.requires_grad_()
    losses = detection_loss(decode_boxes(raw, anchors), raw[..., 4:], anchors, torch.zeros(shape))
    assert losses["iou_loss"] == losses["cls_loss"] == losses["l1_loss"] == 0
    torch.testing.assert_close(losses["loss"], torch.nn.functional.softplus(raw[..., 4]).sum())
    assert losses["num_fg"] == 1
    losses["loss"].backward()
    assert raw.grad.isfinite().all()


def test_an_object_far_outside_the_frame_is_nobodys():
    raw, anchors, _ = crowded_frames(frames=1)
    labels = torch.tensor([[[1.0, 5000.0, 5000.0, 20.0, 20.0]]])
    found = assign(decode_boxes(raw, anchors), raw[..., 4:], anchors, labels)
    assert len(found.frame) == 0


def test_a_perfect_prediction_costs_nothing_but_confidence():
    anchors = anchor_grid(((1, 1),), (8,), torch.device("cpu"))
    boxes = torch.tensor([[[4.0, 4.0, 6.0, 6.0]]])
    labels = torch.tensor([[[1.0, 4.0, 4.0, 6.0, 6.0]]])
    logits = torch.tensor([[[0.0, -40.0, 40.0]]])
    losses = detection_loss(boxes, logits, anchors, labels)
    assert losses["iou_loss"] == pytest.approx(0, abs=1e-6)
    assert losses["cls_loss"] == pytest.approx(0, abs=1e-6)
    assert losses["conf_loss"] == pytest.approx(math.log(2))
    # Half the width: IoU 1/2, so 5 (1 - 1/4), and the class target is the IoU.
    boxes[..., 2] /= 2
    losses = detection_loss(boxes, torch.zeros(1, 1, 3), anchors, labels)
    assert losses["iou_loss"] == pytest.approx(3.75)
    assert losses["cls_loss"] == pytest.approx(2 * math.log(2))


def test_l1_loss_vanishes_at_its_target():
    anchors = anchor_grid(((1, 1),), (8,), torch.device("cpu"))
    offsets = torch.tensor([[[0.5, 0.25, math.log(2), 0.0]]])
    labels = torch.tensor([[[0.0, 4.0, 2.0, 16.0, 8.0]]])
    boxes = decode_boxes(offsets, anchors)
    torch.testing.assert_close(boxes, labels[..., 1:])
    logits = torch.zeros(1, 1, 3)
    assert detection_loss(boxes, logits, anchors, labels, offsets)["l1_loss"] < 1e-6
    shifted = detection_loss(boxes, logits, anchors, labels, offsets + 0.1)["l1_loss"]
    assert shifted == pytest.approx(0.4, abs=1e-5)


def test_pairwise_iou_of_known_boxes():
    first = torch.tensor([[0.0, 0.0, 4.0, 4.0]])
    second = torch.tensor([[0.0, 0.0, 4.0, 4.0], [2.0, 0.0, 4.0, 4.0], [4.0, 0.0, 4.0, 4.0]])
    torch.testing.assert_close(pairwise_iou(first, second), torch.tensor([[1.0, 1 / 3, 0.0]]))
