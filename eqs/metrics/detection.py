"""Mean average precision of detections, by the COCO definition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torchmetrics import Metric
from torchmetrics.utilities import dim_zero_cat

from eqs.extras import needed

if TYPE_CHECKING:
    from faster_coco_eval import COCO

AREAS = ("all", "small", "medium", "large")


class MeanAveragePrecision(Metric):
    """Average precision over IoU 0.50 to 0.95, 101 recall points, as COCO defines it.

    Takes and names what torchmetrics' metric does, but evaluates with faster-coco-eval, whose
    numbers equal those of pycocotools. Values are fractions in [0, 1].

    Convention: a value is -1 where there is no ground truth to find, as in pycocotools, and the
    mean over classes leaves such classes out. Frames without ground truth count: every detection
    there is false. The Prophesee protocol drops them; `drop_empty_frames` does so.

    Source: Lin et al., "Microsoft COCO", ECCV 2014.

    Args:
        num_classes: report classes 0 to `num_classes - 1`; None reports those that occur.
        max_detections: highest-scored detections used per frame and class.
        drop_empty_frames: leave out frames without ground truth, detections included.
        **kwargs: passed on to `torchmetrics.Metric`.

    Example:
        >>> box = torch.tensor([[10.0, 10.0, 50.0, 50.0]])
        >>> metric = MeanAveragePrecision()
        >>> metric.update(
        ...     [{"boxes": box, "scores": torch.tensor([0.9]), "labels": torch.tensor([0])}],
        ...     [{"boxes": box, "labels": torch.tensor([0])}],
        ... )
        >>> round(float(metric.compute()["map"]), 6)
        1.0
    """

    higher_is_better = True
    is_differentiable = False
    full_state_update = False

    # Flat rows, so that processes with different numbers of boxes, or none, can be gathered.
    detections: list[Tensor]
    detections_per_frame: list[Tensor]
    truths: list[Tensor]
    truths_per_frame: list[Tensor]

    def __init__(
        self,
        num_classes: int | None = None,
        max_detections: int = 100,
        drop_empty_frames: bool = False,
        **kwargs: object,
    ) -> None:
        """Check the options and prepare the lists of frames."""
        with needed("train", "to compute a mAP"):
            import faster_coco_eval  # noqa: F401
        super().__init__(**kwargs)
        if max_detections < 1:
            raise ValueError(f"Expected max_detections of at least 1, got {max_detections}")
        self.num_classes = num_classes
        self.max_detections = max_detections
        self.drop_empty_frames = drop_empty_frames
        for name in ("detections", "detections_per_frame", "truths", "truths_per_frame"):
            self.add_state(name, [], dist_reduce_fx="cat")

    def update(
        self, preds: Sequence[Mapping[str, Tensor]], target: Sequence[Mapping[str, Tensor]]
    ) -> None:
        """Add frames.

        Args:
            preds: for each frame `boxes` (n, 4) as x1, y1, x2, y2 in pixels, `scores` (n,) and
                `labels` (n,).
            target: for each frame `boxes` and `labels`.

        Raises:
            ValueError: the lists differ in length, or a frame's tensors do not fit together.
        """
        if len(preds) != len(target):
            raise ValueError(
                f"Expected predictions and targets for the same frames, got {len(preds)} and "
                f"{len(target)}"
            )
        for frame_preds, frame_target in zip(preds, target, strict=True):
            found = _rows(frame_preds, ("boxes", "scores", "labels"))
            wanted = _rows(frame_target, ("boxes", "labels"))
            self._check_labels(found[:, -1], wanted[:, -1])
            self.detections.append(found.flatten())
            self.detections_per_frame.append(found.new_tensor([len(found)]))
            self.truths.append(wanted.flatten())
            self.truths_per_frame.append(wanted.new_tensor([len(wanted)]))

    def _check_labels(self, *labels: Tensor) -> None:
        for each in labels:
            if self.num_classes is not None and len(each) and each.max() >= self.num_classes:
                raise ValueError(
                    f"Expected labels below {self.num_classes}, got {int(each.max())}; "
                    "set num_classes"
                )

    def compute(self) -> dict[str, Tensor]:
        """The COCO summary.

        Returns:
            `map`, `map_50`, `map_75`, `map_small`, `map_medium`, `map_large` as scalars; by class
            `classes`, `map_per_class`, `map_50_per_class` and `ground_truths_per_class`.
        """
        detections = _split(self.detections, self.detections_per_frame, 6)
        truths = _split(self.truths, self.truths_per_frame, 5)
        if self.drop_empty_frames:
            kept = [index for index, rows in enumerate(truths) if len(rows)]
            detections = [detections[index] for index in kept]
            truths = [truths[index] for index in kept]
        classes = self._classes(detections, truths)
        precision = _precision(detections, truths, classes, self.max_detections)
        labels = np.concatenate([rows[:, -1] for rows in truths] or [np.zeros(0, np.float32)])
        values: dict[str, Any] = {
            "map": _average(precision),
            "map_50": _average(precision[:1]),
            "map_75": _average(precision[5:6]),
            **{
                f"map_{area}": _average(precision, area=index)
                for index, area in enumerate(AREAS)
                if index
            },
            "map_per_class": [_average(precision[:, :, k]) for k in range(len(classes))],
            "map_50_per_class": [_average(precision[:1, :, k]) for k in range(len(classes))],
        }
        counts = {
            "classes": classes,
            "ground_truths_per_class": [int((labels == label).sum()) for label in classes],
        }
        return {
            **{key: torch.tensor(value, dtype=torch.float32) for key, value in values.items()},
            **{key: torch.tensor(value, dtype=torch.int64) for key, value in counts.items()},
        }

    def _classes(
        self, detections: Sequence[NDArray[np.float32]], truths: Sequence[NDArray[np.float32]]
    ) -> list[int]:
        if self.num_classes is not None:
            return list(range(self.num_classes))
        return sorted({int(label) for rows in (*detections, *truths) for label in rows[:, -1]})


def _rows(frame: Mapping[str, Tensor], names: Sequence[str]) -> Tensor:
    """Boxes, scores and labels of one frame side by side, float32, shape (n, 5 or 6)."""
    missing = [name for name in names if name not in frame]
    if missing:
        raise ValueError(f"Expected a frame with {', '.join(names)}, got none of {missing}")
    boxes = frame["boxes"].reshape(-1, 4) if not frame["boxes"].numel() else frame["boxes"]
    columns = [frame[name].reshape(-1, 1) for name in names[1:]]
    if boxes.ndim != 2 or boxes.shape[1] != 4 or any(len(c) != len(boxes) for c in columns):
        shapes = {name: tuple(frame[name].shape) for name in names}
        raise ValueError(f"Expected boxes (n, 4) with n scores and labels, got {shapes}")
    rows = torch.cat([boxes.float(), *(column.to(boxes.device).float() for column in columns)], 1)
    if not torch.isfinite(rows).all():
        raise ValueError("Expected finite boxes and scores, got NaN or infinity")
    return rows.detach()


def _split(
    rows: list[Tensor] | Tensor, counts: list[Tensor] | Tensor, columns: int
) -> list[NDArray[np.float32]]:
    """The rows of each frame, shape (n, columns)."""
    if isinstance(counts, list) and not counts:
        return []
    table = dim_zero_cat(rows).reshape(-1, columns).cpu().numpy()
    stops = np.cumsum(dim_zero_cat(counts).cpu().numpy().astype(np.int64))
    return np.split(table, stops[:-1])


def _precision(
    detections: Sequence[NDArray[np.float32]],
    truths: Sequence[NDArray[np.float32]],
    classes: Sequence[int],
    max_detections: int,
) -> NDArray[np.float64]:
    """Precision by (IoU, recall, class, area); -1 where there is no ground truth."""
    if not sum(map(len, truths)):
        return np.full((10, 101, len(classes), len(AREAS)), -1.0)
    from faster_coco_eval import COCOeval_faster

    evaluation = COCOeval_faster(
        _dataset(truths, classes),
        _dataset(detections, classes),
        iouType="bbox",
        print_function=_silent,
    )
    evaluation.params.maxDets = [1, 10, max_detections]
    evaluation.evaluate()
    evaluation.accumulate()
    precision: NDArray[np.float64] = evaluation.eval["precision"][..., -1]
    return precision


def _dataset(frames: Sequence[NDArray[np.float32]], classes: Sequence[int]) -> COCO:
    """Boxes as the COCO toolkit wants them; ids start at 1 because 0 means unmatched there."""
    from faster_coco_eval import COCO

    annotations: list[dict[str, Any]] = []
    for image_id, rows in enumerate(frames, start=1):
        sides = rows[:, 2:4].astype(np.float64) - rows[:, :2]
        boxes = np.concatenate([rows[:, :2], sides], axis=1).tolist()
        areas, labels = sides.prod(axis=1).tolist(), rows[:, -1].astype(int).tolist()
        scores = rows[:, 4].tolist()  # a label where there is no score, and not read then
        annotations += [
            {
                "id": len(annotations) + index,
                "image_id": image_id,
                "category_id": label,
                "bbox": box,
                "area": area,
                "iscrowd": 0,
                "score": score,
            }
            for index, (box, area, label, score) in enumerate(
                zip(boxes, areas, labels, scores, strict=True), start=1
            )
        ]
    coco = COCO(print_function=_silent)
    coco.dataset = {
        "images": [{"id": image_id} for image_id in range(1, len(frames) + 1)],
        "categories": [{"id": label, "name": str(label)} for label in classes],
        "annotations": annotations,
    }
    coco.createIndex()
    return coco


def _average(precision: NDArray[np.float64], area: int = 0) -> float:
    values = precision[..., area]
    known = values[values > -1]
    return float(known.mean()) if known.size else -1.0


def _silent(*_: object) -> None:
    """Where the toolkit would print."""
