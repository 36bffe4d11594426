"""Thresholds and suppression of decoded predictions."""

import pytest
import torch

from eqs.models import postprocess


def plain(rows, confidence, nms):
    """Greedy suppression within classes, written over Python lists."""
    boxes = []
    for cx, cy, w, h, objectness, *classes in rows.double().tolist():
        label = max(range(len(classes)), key=lambda k: classes[k])
        box = (cx - w / 2, cy - h / 2, cx + w / 2, cy + h / 2)
        boxes.append((objectness * classes[label], label, box))
    kept = []
    for score, label, box in sorted(boxes, key=lambda entry: -entry[0]):
        if score < confidence:
            continue
        if all(other != label or iou(box, b) <= nms for _, other, b in kept):
            kept.append((score, label, box))
    return kept


def iou(a, b):
    width = max(min(a[2], b[2]) - max(a[0], b[0]), 0)
    height = max(min(a[3], b[3]) - max(a[1], b[1]), 0)
    area = (a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - width * height
    return width * height / area


def random_predictions(images=3, anchors=60, classes=3, seed=0):
    generator = torch.Generator().manual_seed(seed)
    rows = torch.rand(images, anchors, 5 + classes, generator=generator)
    rows[..., :2] *= 60
    rows[..., 2:4] = 10 + 30 * rows[..., 2:4]
    return rows


@pytest.mark.parametrize("limit", [None, 4])
def test_agrees_with_the_plain_way(limit):
    predictions = random_predictions()
    before = predictions.clone()
    for found, rows in zip(postprocess(predictions, 0.2, 0.5, limit), predictions, strict=True):
        expected = plain(rows, 0.2, 0.5)[:limit]
        assert len(found["scores"]) == len(expected) > 3
        scores, labels, boxes = zip(*expected, strict=True)
        torch.testing.assert_close(found["scores"], torch.tensor(scores))
        assert found["labels"].tolist() == list(labels)
        torch.testing.assert_close(found["boxes"], torch.tensor(boxes), atol=1e-5, rtol=1e-6)
    assert torch.equal(predictions, before)


def test_class_score_changes_scores_only():
    predictions = random_predictions()
    product, alone = postprocess(predictions)[0], postprocess(predictions, class_score=True)[0]
    assert torch.equal(product["boxes"], alone["boxes"])
    assert (alone["scores"] >= product["scores"]).all()
    assert set(alone["scores"].tolist()) <= set(predictions[0, :, 5:].flatten().tolist())


def test_threshold_is_inclusive_and_overlap_limit_is_not():
    # Two equal squares, one shifted by a third: IoU exactly 1/2 in binary fractions.
    rows = torch.tensor([[6.0, 6.0, 12.0, 8.0, 0.5, 1.0], [10.0, 6.0, 12.0, 8.0, 0.25, 1.0]])
    assert len(postprocess(rows[None], 0.25, 0.5)[0]["scores"]) == 2
    assert len(postprocess(rows[None], 0.25, 0.49)[0]["scores"]) == 1
    assert len(postprocess(rows[None], 0.26, 0.5)[0]["scores"]) == 1


def test_nothing_found_gives_empty_tensors():
    found = postprocess(torch.zeros(2, 5, 7), 0.1)
    assert [tuple(frame["boxes"].shape) for frame in found] == [(0, 4), (0, 4)]
    assert found[0]["labels"].dtype == torch.int64
    assert postprocess(torch.zeros(0, 5, 7)) == []
