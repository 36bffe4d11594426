"""Mean average precision against the COCO toolkit and by hand."""

import contextlib
import io
import itertools

import numpy as np
import pytest
import torch
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

from eqs.metrics import MeanAveragePrecision

SUMMARY = ("map", "map_50", "map_75", "map_small", "map_medium", "map_large")


def frames(seed, count=40, classes=3, clutter=6, truths=5):
    """Random ground truth, and detections that follow it with errors."""
    generator = np.random.default_rng(seed)

    def boxes(n):
        corner = generator.uniform(0, 300, (n, 2))
        return np.c_[corner, corner + np.exp(generator.uniform(1.5, 5, (n, 2)))]

    preds, target = [], []
    for _ in range(count):
        n, k = generator.integers(0, truths + 1), generator.integers(0, clutter + 1)
        real, labels = boxes(n), generator.integers(0, classes, n)
        found = generator.random(n) < 0.8
        near = real[found] + generator.normal(0, 1, (found.sum(), 4))
        scores = np.round(generator.random(found.sum() + k), 2)
        preds.append(
            {
                "boxes": torch.tensor(np.r_[near, boxes(k)], dtype=torch.float32),
                "scores": torch.tensor(scores, dtype=torch.float32),
                "labels": torch.tensor(np.r_[labels[found], generator.integers(0, classes, k)]),
            }
        )
        target.append(
            {"boxes": torch.tensor(real, dtype=torch.float32), "labels": torch.tensor(labels)}
        )
    return preds, target


def toolkit(preds, target, classes):
    """What pycocotools says: its twelve numbers and the precision table."""

    def rows(batch):
        out = []
        for image_id, frame in enumerate(batch, start=1):
            for index, (x0, y0, x1, y1) in enumerate(frame["boxes"].double().tolist()):
                row = {
                    "id": len(out) + 1,
                    "image_id": image_id,
                    "category_id": int(frame["labels"][index]),
                    "bbox": [x0, y0, x1 - x0, y1 - y0],
                    "area": (x1 - x0) * (y1 - y0),
                    "iscrowd": 0,
                }
                out.append(
                    row | ({"score": float(frame["scores"][index])} if "scores" in frame else {})
                )
        return out

    with contextlib.redirect_stdout(io.StringIO()):
        truth, found = COCO(), COCO()
        for coco, batch in ((truth, target), (found, preds)):
            coco.dataset = {
                "images": [{"id": index + 1} for index in range(len(target))],
                "categories": [{"id": label} for label in range(classes)],
                "annotations": rows(batch),
            }
            coco.createIndex()
        evaluation = COCOeval(truth, found, "bbox")
        evaluation.evaluate()
        evaluation.accumulate()
        evaluation.summarize()
    return evaluation.stats, evaluation.eval["precision"]


@pytest.mark.parametrize("seed", range(4))
def test_agrees_with_the_toolkit(seed):
    preds, target = frames(seed)
    metric = MeanAveragePrecision(num_classes=3)
    metric.update(preds, target)
    values = metric.compute()
    stats, precision = toolkit(preds, target, 3)
    for name, expected in zip(SUMMARY, stats, strict=False):
        assert float(values[name]) == pytest.approx(expected, abs=1e-6), name
    assert 0.1 < values["map"] < 0.9
    per_class = precision[:, :, :, 0, -1].mean(axis=(0, 1))
    np.testing.assert_allclose(values["map_per_class"], per_class, atol=1e-6)
    np.testing.assert_allclose(
        values["map_50_per_class"], precision[0, :, :, 0, -1].mean(axis=0), atol=1e-6
    )


@pytest.mark.parametrize(
    ("clutter", "truths"), [(0, 4), (5, 0), (150, 3)], ids=["no clutter", "no truth", "crowded"]
)
def test_agrees_with_the_toolkit_at_the_edges(clutter, truths):
    preds, target = frames(7, count=8, clutter=clutter, truths=truths)
    metric = MeanAveragePrecision(num_classes=3)
    metric.update(preds, target)
    stats, _ = toolkit(preds, target, 3)
    np.testing.assert_allclose(
        [float(metric.compute()[name]) for name in SUMMARY], stats[:6], atol=1e-6
    )


def test_no_detections_at_all_scores_zero():
    _, target = frames(1)
    nothing = [
        {"boxes": torch.zeros(0, 4), "scores": torch.zeros(0), "labels": torch.zeros(0).long()}
    ] * len(target)
    metric = MeanAveragePrecision(num_classes=3)
    metric.update(nothing, target)
    values = metric.compute()
    assert values["map"] == values["map_50"] == 0
    assert values["map_per_class"].tolist() == [0, 0, 0]


def test_missing_classes_read_minus_one_and_do_not_count():
    box = torch.tensor([[10.0, 10.0, 60.0, 60.0]])
    metric = MeanAveragePrecision(num_classes=3)
    metric.update(
        [{"boxes": box, "scores": torch.tensor([0.5]), "labels": torch.tensor([1])}],
        [{"boxes": box, "labels": torch.tensor([1])}],
    )
    values = metric.compute()
    assert values["map"] == pytest.approx(1)
    assert values["map_per_class"].tolist() == pytest.approx([-1, 1, -1])
    assert values["ground_truths_per_class"].tolist() == [0, 1, 0]
    assert values["map_small"] == -1


def test_no_frames_at_all():
    metric = MeanAveragePrecision()
    metric.update([], [])
    values = metric.compute()
    assert values["map"] == -1
    assert values["classes"].tolist() == []


def test_false_detections_on_empty_frames_count_unless_dropped():
    box = torch.tensor([[10.0, 10.0, 60.0, 60.0]])
    hit = {"boxes": box, "scores": torch.tensor([0.5]), "labels": torch.tensor([0])}
    miss = {"boxes": box, "scores": torch.tensor([0.9]), "labels": torch.tensor([0])}
    truth = {"boxes": box, "labels": torch.tensor([0])}
    empty = {"boxes": torch.zeros(0, 4), "labels": torch.zeros(0).long()}
    expected = {False: 0.5, True: 1.0}
    for drop, value in expected.items():
        metric = MeanAveragePrecision(drop_empty_frames=drop)
        metric.update([hit, miss], [truth, empty])
        assert metric.compute()["map"] == pytest.approx(value, abs=1e-6)


def test_batches_do_not_matter():
    preds, target = frames(3)
    once, often = MeanAveragePrecision(), MeanAveragePrecision()
    once.update(preds, target)
    for index in range(len(preds)):
        often.update(preds[index : index + 1], target[index : index + 1])
    assert float(once.compute()["map"]) == float(often.compute()["map"])
    often.reset()
    often.update([], [])
    assert often.compute()["map"] == -1


def test_gathered_processes_equal_one():
    preds, target = frames(5)
    whole = MeanAveragePrecision(num_classes=3)
    whole.update(preds, target)
    joined: dict = {}
    names = itertools.cycle(whole.metric_state)
    ranks = [
        MeanAveragePrecision(
            num_classes=3,
            dist_sync_fn=lambda state, group=None: joined[next(names)],
            distributed_available_fn=lambda: True,
        )
        for _ in range(3)
    ]
    ranks[0].update(preds[:25], target[:25])
    ranks[1].update(preds[25:], target[25:])
    ranks[2].update([], [])  # a process without frames
    for name in whole.metric_state:
        joined[name] = [torch.cat([torch.zeros(0), *getattr(rank, name)]) for rank in ranks]
    for rank in ranks:
        assert rank.compute()["map"] == whole.compute()["map"]


def test_nothing_is_printed(capsys):
    metric = MeanAveragePrecision()
    metric.update(*frames(2, count=5))
    metric.compute()
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"scores": None}, r"got none of \['scores'\]"),
        ({"boxes": torch.zeros(2, 4)}, r"boxes \(n, 4\) with n scores"),
        ({"boxes": torch.full((1, 4), torch.nan)}, "finite boxes"),
        ({"labels": torch.tensor([5])}, "labels below 3, got 5; set num_classes"),
    ],
)
def test_bad_frames_are_refused(change, message):
    frame = {
        "boxes": torch.tensor([[0.0, 0, 9, 9]]),
        "scores": torch.ones(1),
        "labels": torch.zeros(1).long(),
    }
    bad = {key: value for key, value in {**frame, **change}.items() if value is not None}
    with pytest.raises(ValueError, match=message):
        MeanAveragePrecision(num_classes=3).update([bad], [frame])
    with pytest.raises(ValueError, match="same frames, got 1 and 2"):
        MeanAveragePrecision().update([frame], [frame, frame])
