"""From decoded predictions to a list of boxes per frame."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from eqs.kernels import njit

Detections = dict[str, Tensor]


def postprocess(
    predictions: Tensor,
    confidence_threshold: float = 0.1,
    nms_threshold: float = 0.45,
    max_detections: int | None = None,
    *,
    class_score: bool = False,
) -> list[Detections]:
    """Threshold, then suppress overlapping boxes class by class, best first.

    Args:
        predictions: (N, A, 5 + K), cx, cy, w, h, objectness, class confidences, as the detector
            returns them. Not changed.
        confidence_threshold: smallest objectness times class confidence that is kept, inclusive.
        nms_threshold: IoU above which the weaker of two boxes of one class goes.
        max_detections: at most so many per frame, None for all.
        class_score: return the class confidence alone as the score, as RVT's evaluation on Gen1
            and 1 Mpx does. Thresholds and order use the product all the same.

    Returns:
        For each frame `boxes` (n, 4) as x1, y1, x2, y2 in pixels, `scores` (n,), `labels` (n,)
        int64, by decreasing product. Frames without detections have empty tensors.

    Convention: an anchor stands for its best class only.
    """
    confidence, classes = predictions[..., 5:].float().max(-1)
    product = predictions[..., 4].float() * confidence
    scores = confidence if class_score else product
    half = predictions[..., 2:4].float() / 2
    centres = predictions[..., :2].float()
    boxes = torch.cat((centres - half, centres + half), dim=-1)
    results = []
    for image in range(len(predictions)):
        kept = (product[image] >= confidence_threshold).nonzero().squeeze(1)
        kept = kept[product[image, kept].argsort(descending=True, stable=True)]
        survivors = suppress(
            boxes[image, kept].cpu().numpy(),
            classes[image, kept].cpu().numpy(),
            nms_threshold,
            len(kept) if max_detections is None else max_detections,
        )
        kept = kept[torch.from_numpy(survivors).to(kept.device)]
        results.append(
            {
                "boxes": boxes[image, kept],
                "scores": scores[image, kept],
                "labels": classes[image, kept],
            }
        )
    return results


@njit(cache=True)
def suppress(
    boxes: NDArray[np.float32], classes: NDArray[np.int64], threshold: float, limit: int
) -> NDArray[np.int64]:
    """Greedy class-wise non-maximum suppression.

    Args:
        boxes: (n, 4) x1, y1, x2, y2, best first.
        classes: (n,).
        threshold: IoU above which a box falls to a better one of its class.
        limit: stop after so many survivors.

    Returns:
        Indices of the survivors, ascending.
    """
    kept = np.empty(min(len(boxes), limit), np.int64)
    count = 0
    for i in range(len(boxes)):
        if count == len(kept):
            break
        x1, y1, x2, y2 = boxes[i, 0], boxes[i, 1], boxes[i, 2], boxes[i, 3]
        area = (x2 - x1) * (y2 - y1)
        survives = True
        for k in range(count):
            j = kept[k]
            if classes[j] != classes[i]:
                continue
            width = min(x2, boxes[j, 2]) - max(x1, boxes[j, 0])
            height = min(y2, boxes[j, 3]) - max(y1, boxes[j, 1])
            if width <= 0 or height <= 0:
                continue
            overlap = width * height
            other = (boxes[j, 2] - boxes[j, 0]) * (boxes[j, 3] - boxes[j, 1])
            if overlap > threshold * (area + other - overlap):
                survives = False
                break
        if survives:
            kept[count] = i
            count += 1
    return kept[:count]
