"""SimOTA: which anchors learn which object (Ge et al., YOLOX, 2021), for all frames at once."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional

CENTRE_RADIUS = 1.5
IOU_COST = 3.0
OUT_OF_RANGE_COST = 1e6
TOP_CANDIDATES = 10
# Binary cross-entropy bounds its logarithms, as PyTorch's own does.
LOG_FLOOR = -100.0


class Assignment(NamedTuple):
    """The P foreground anchors: index of frame, anchor and label row, and the IoU of the two."""

    frame: Tensor
    anchor: Tensor
    row: Tensor
    iou: Tensor


def pairwise_iou(first: Tensor, second: Tensor) -> Tensor:
    """IoU (..., M, A) of boxes (..., M, 4) with boxes (..., A, 4), both cx, cy, w, h."""
    first, second = first[..., :, None, :], second[..., None, :, :]
    low = torch.maximum(first[..., :2] - first[..., 2:] / 2, second[..., :2] - second[..., 2:] / 2)
    high = torch.minimum(first[..., :2] + first[..., 2:] / 2, second[..., :2] + second[..., 2:] / 2)
    overlap = (high - low).clamp(min=0).prod(-1)
    union = first[..., 2:].prod(-1) + second[..., 2:].prod(-1) - overlap
    return overlap / union.clamp(min=1e-16)


def in_range(labels: Tensor, anchors: Tensor) -> Tensor:
    """Whether an anchor's centre (F, M, A) is strictly within 1.5 strides of an object's centre."""
    centres = (anchors[:, :2] + 0.5) * anchors[:, 2:]
    offset = (labels[:, :, None, 1:3] - centres).abs()
    return (offset < CENTRE_RADIUS * anchors[:, 2:]).all(-1)


def class_cost(logits: Tensor, classes: Tensor) -> Tensor:
    """Cross-entropy (F, M, C) between one-hot classes (F, M) and candidates (F, C, 1 + K).

    The score of a class is the root of objectness times class confidence. The sum over classes
    splits into a part per candidate and a correction for the object's class.
    """
    score = (logits[..., 1:].sigmoid() * logits[..., :1].sigmoid()).sqrt()
    hit = score.log().clamp(min=LOG_FLOOR)
    miss = (1 - score).log().clamp(min=LOG_FLOOR)
    classes = classes[:, :, None].expand(-1, -1, logits.shape[1])
    correction = (miss - hit).transpose(1, 2).gather(1, classes)
    return correction - miss.sum(-1)[:, None]


@torch.no_grad()
def assign(boxes: Tensor, logits: Tensor, anchors: Tensor, labels: Tensor) -> Assignment:
    """Assign anchors to objects.

    Args:
        boxes: decoded boxes (F, A, 4), float32.
        logits: objectness and class logits (F, A, 1 + K).
        anchors: (A, 3), grid column, grid row, stride.
        labels: (F, M, 5) rows class, cx, cy, w, h in pixels; zero rows are padding.
    """
    if labels.shape[1] == 0:
        labels = functional.pad(labels, (0, 0, 0, 1))
    valid = labels.sum(-1) > 0
    near = in_range(labels, anchors) & valid[..., None]
    candidate, real = _candidates(near.any(1))
    frames = torch.arange(len(labels), device=labels.device)[:, None]
    iou = pairwise_iou(labels[..., 1:], boxes[frames, candidate])
    usable = valid[..., None] & real[:, None]
    iou = iou.masked_fill(~usable, 0)
    near = near.gather(2, candidate[:, None].expand(-1, labels.shape[1], -1))
    cost = class_cost(logits[frames, candidate].float(), labels[..., 0].long())
    cost = cost - IOU_COST * (iou + 1e-8).log() + OUT_OF_RANGE_COST * ~near
    cost = cost.masked_fill(~usable, torch.inf)
    taken = _cheapest(cost, iou) & usable
    contested = taken.sum(1) > 1
    winner = torch.where(contested, cost.argmin(1), taken.int().argmax(1))
    frame, position = taken.any(1).nonzero(as_tuple=True)
    row = winner[frame, position]
    return Assignment(frame, candidate[frame, position], row, iou[frame, row, position])


def _candidates(any_near: Tensor) -> tuple[Tensor, Tensor]:
    """Anchor indices (F, C) of the candidates, padded to the fullest frame, and which are real."""
    frame, anchor = any_near.nonzero(as_tuple=True)
    counts = any_near.sum(1)
    size = max(int(counts.max()), 1) if len(counts) else 1
    first = counts.cumsum(0) - counts
    position = torch.arange(len(frame), device=frame.device) - first[frame]
    candidate = anchor.new_zeros((len(counts), size))
    candidate[frame, position] = anchor
    return candidate, torch.arange(size, device=frame.device) < counts[:, None]


def _cheapest(cost: Tensor, iou: Tensor) -> Tensor:
    """Each object takes as many of its cheapest candidates as its best IoUs sum to."""
    top = min(TOP_CANDIDATES, cost.shape[-1])
    wanted = iou.topk(top, dim=-1).values.sum(-1).int().clamp(min=1)
    order = cost.topk(top, dim=-1, largest=False).indices
    chosen = torch.arange(top, device=cost.device) < wanted[..., None]
    return torch.zeros_like(cost, dtype=torch.bool).scatter_(-1, order, chosen)
