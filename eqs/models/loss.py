"""The detection loss of YOLOX as RVT uses it, batched over frames."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, one_hot

from eqs.models.assignment import Assignment, assign
from eqs.models.synchronised import mean_over_processes

IOU_WEIGHT = 5.0


def detection_loss(
    boxes: Tensor,
    logits: Tensor,
    anchors: Tensor,
    labels: Tensor,
    offsets: Tensor | None = None,
) -> dict[str, Tensor]:
    """Loss of F frames, summed over all and divided by the number of foreground anchors.

    Where several processes train together, each divides by their mean number: the mean of their
    losses, and of their gradients, is then that of one process with all the frames.

    Args:
        boxes: decoded boxes (F, A, 4), cx, cy, w, h in pixels, float32.
        logits: objectness and class logits (F, A, 1 + K), float32.
        anchors: (A, 3), grid column, grid row, stride.
        labels: (F, M, 5) rows class, cx, cy, w, h in pixels; zero rows are padding.
        offsets: raw box outputs (F, A, 4) to add the L1 loss on them; None leaves it out, as
            RVT does.

    Returns:
        Scalars `loss`, `iou_loss`, `conf_loss`, `cls_loss`, `l1_loss`, `num_fg`.

    Convention: `iou_loss` already carries its weight of 5; `num_fg` is foreground anchors per
    object, not a count.
    """
    found = assign(boxes.detach(), logits.detach(), anchors, labels)
    foreground = logits.new_tensor(len(found.frame))
    count = mean_over_processes(foreground).clamp(min=1)
    target = labels[found.frame, found.row]
    iou_loss = _iou_loss(boxes[found.frame, found.anchor], target[:, 1:]) * IOU_WEIGHT / count
    objectness = torch.zeros_like(logits[..., 0])
    objectness[found.frame, found.anchor] = 1
    conf_loss = _cross_entropy(logits[..., 0], objectness) / count
    hot = one_hot(target[:, 0].long(), logits.shape[-1] - 1) * found.iou[:, None]
    cls_loss = _cross_entropy(logits[found.frame, found.anchor, 1:], hot) / count
    l1_loss = torch.zeros_like(conf_loss)
    if offsets is not None:
        l1_loss = _l1_loss(offsets, anchors, found, target[:, 1:]) / count
    objects = (labels.sum(-1) > 0).sum().clamp(min=1)
    return {
        "loss": iou_loss + conf_loss + cls_loss + l1_loss,
        "iou_loss": iou_loss,
        "conf_loss": conf_loss,
        "cls_loss": cls_loss,
        "l1_loss": l1_loss,
        "num_fg": foreground.clamp(min=1) / objects,
    }


def _cross_entropy(logits: Tensor, target: Tensor) -> Tensor:
    return binary_cross_entropy_with_logits(logits, target, reduction="sum")


def _iou_loss(predicted: Tensor, target: Tensor) -> Tensor:
    """Sum of 1 - IoU^2 over pairs of boxes (P, 4)."""
    low = torch.maximum(predicted[:, :2] - predicted[:, 2:] / 2, target[:, :2] - target[:, 2:] / 2)
    high = torch.minimum(predicted[:, :2] + predicted[:, 2:] / 2, target[:, :2] + target[:, 2:] / 2)
    overlap = (high - low).clamp(min=0).prod(-1)
    union = predicted[:, 2:].prod(-1) + target[:, 2:].prod(-1) - overlap
    return (1 - (overlap / (union + 1e-16)) ** 2).sum()


def _l1_loss(offsets: Tensor, anchors: Tensor, found: Assignment, boxes: Tensor) -> Tensor:
    grid = anchors[found.anchor]
    centres = boxes[:, :2] / grid[:, 2:] - grid[:, :2]
    sizes = (boxes[:, 2:] / grid[:, 2:] + 1e-8).log()
    target = torch.cat((centres, sizes), dim=-1)
    return (offsets[found.frame, found.anchor] - target).abs().sum()
