"""The detector computed plainly: one time step after the other, every operation by itself.

This is the order in which the published program computes, on the parameters of our own modules. A
test holds the fast path to its results, `benchmark.py rvt` to its time. Pyramid and head run on all
frames at once there too and are shared.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import torch
from torch import Tensor
from torch.nn import functional

from eqs.models import RVTDetector
from eqs.models.assignment import (
    IOU_COST,
    OUT_OF_RANGE_COST,
    TOP_CANDIDATES,
    in_range,
    pairwise_iou,
)
from eqs.models.attention import FROM_GROUPS, TO_GROUPS, PartitionAttention, cells
from eqs.models.backbone import AttentionPair, RVTBackbone, Stage
from eqs.models.loss import IOU_WEIGHT
from eqs.models.lstm import ConvLSTM, State
from eqs.models.yolox_head import decode_boxes


def attention_block(block: PartitionAttention, x: Tensor, partition: tuple[int, int]) -> Tensor:
    """One block on (B, H, W, C): scores and weights are tensors of their own."""
    attention = block.self_attn
    grouped = cells(x, partition, block.kind).permute(TO_GROUPS[block.kind]).contiguous()
    tokens = block.norm1(grouped.view(-1, partition[0] * partition[1], x.shape[-1]))
    groups, count, channels = tokens.shape
    qkv = attention.qkv(tokens).view(groups, count, attention.num_heads, -1).transpose(1, 2)
    query, key, value = qkv.chunk(3, dim=-1)
    scores = (query @ key.transpose(-2, -1)) * query.shape[-1] ** -0.5
    mixed = (scores.softmax(dim=-1) @ value).transpose(1, 2).reshape(groups, count, channels)
    branch = block.ls1.gamma * attention.proj(mixed)
    branch = branch.view(grouped.shape).permute(FROM_GROUPS[block.kind]).reshape(x.shape)
    x = x + branch
    first, _, last = block.mlp.net
    transformed: Tensor = x + block.ls2.gamma * last(first(block.norm2(x)))
    return transformed


def recurrent_cell(lstm: ConvLSTM, x: Tensor, state: State | None) -> State:
    """One step of the cell on (N, C, H, W)."""
    hidden, cell = (torch.zeros_like(x), torch.zeros_like(x)) if state is None else state
    gates = lstm.conv1x1(torch.cat((x, hidden), dim=1))
    forget, enter, leave = gates[:, : 3 * lstm.channels].sigmoid().chunk(3, dim=1)
    cell = forget * cell + enter * gates[:, 3 * lstm.channels :].tanh()
    return leave * cell.tanh(), cell


def stage_step(stage: Stage, x: Tensor, state: State | None, partition: tuple[int, int]) -> State:
    """One stage for one time step, (N, C, H, W); the hidden state is its feature."""
    _, tokens = stage.downsample_cf2cl(x)
    pair = cast(AttentionPair, stage.att_blocks[0])
    tokens = attention_block(pair.att_window, tokens, partition)
    tokens = attention_block(pair.att_grid, tokens, partition)
    return recurrent_cell(stage.lstm, tokens.permute(0, 3, 1, 2).contiguous(), state)


def backbone_step(
    backbone: RVTBackbone, x: Tensor, states: Sequence[State] | None
) -> tuple[list[Tensor], list[State]]:
    """All stages for one time step of (N, 20, H, W), a size that needs no padding."""
    partition = (x.shape[-2] // backbone.multiple, x.shape[-1] // backbone.multiple)
    after = []
    for index, stage in enumerate(backbone.stages):
        after.append(
            stage_step(cast(Stage, stage), x, states[index] if states else None, partition)
        )
        x = after[-1][0]
    return [hidden for hidden, _ in after], after


def sequence(
    detector: RVTDetector, x: Tensor, states: Sequence[State] | None = None
) -> tuple[list[Tensor], list[State]]:
    """Features of T steps of (T, N, 20, H, W) as one batch of T * N frames, and the states."""
    steps = []
    after = list(states) if states else None
    for step in x:
        features, after = backbone_step(detector.backbone, step, after)
        steps.append(features)
    return [torch.cat(maps) for maps in zip(*steps, strict=True)], after or []


def frame_assignment(
    boxes: Tensor, logits: Tensor, anchors: Tensor, labels: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Anchors, label rows and IoUs of one frame's foreground, object by object."""
    near = in_range(labels[None], anchors)[0]
    candidates = near.any(0).nonzero()[:, 0]
    near = near[:, candidates]
    iou = pairwise_iou(labels[:, 1:], boxes[candidates])
    scores = (logits[candidates, 1:].sigmoid() * logits[candidates, :1].sigmoid()).sqrt()
    target = functional.one_hot(labels[:, 0].long(), scores.shape[-1]).to(scores)
    pairs = (len(labels), *scores.shape)
    entropy = functional.binary_cross_entropy(
        scores[None].expand(pairs), target[:, None].expand(pairs), reduction="none"
    )
    cost = entropy.sum(-1) - IOU_COST * (iou + 1e-8).log() + OUT_OF_RANGE_COST * ~near
    taken = torch.zeros_like(cost, dtype=torch.bool)
    top = min(TOP_CANDIDATES, len(candidates))
    for row in range(len(labels)):
        wanted = max(int(iou[row].topk(top).values.sum()), 1)
        taken[row, cost[row].topk(wanted, largest=False).indices] = True
    for contested in (taken.sum(0) > 1).nonzero()[:, 0]:
        taken[:, contested] = False
        taken[cost[:, contested].argmin(), contested] = True
    rows, position = taken.nonzero(as_tuple=True)
    return candidates[position], rows, iou[rows, position]


def loss(detector: RVTDetector, features: Sequence[Tensor], labels: Tensor) -> Tensor:
    """The detection loss of (F, M, 5) labels, frame by frame."""
    raw, anchors = detector.yolox_head(detector.fpn(features[-3:]))
    return head_loss(raw.float(), anchors, labels)


def head_loss(raw: Tensor, anchors: Tensor, labels: Tensor) -> Tensor:
    """The loss of raw head outputs (F, A, 5 + classes)."""
    boxes = decode_boxes(raw, anchors)
    total, foreground = raw.new_zeros(()), 0
    for frame, rows in enumerate(labels):
        rows = rows[rows.sum(-1) > 0]
        objectness = torch.zeros_like(raw[frame, :, 4])
        if len(rows):
            with torch.no_grad():
                anchor, row, iou = frame_assignment(boxes[frame], raw[frame, :, 4:], anchors, rows)
            objectness[anchor] = 1
            matched = pairwise_iou(boxes[frame, anchor][:, None], rows[row, 1:][:, None])
            hot = functional.one_hot(rows[row, 0].long(), raw.shape[-1] - 5) * iou[:, None]
            total = total + IOU_WEIGHT * (1 - matched**2).sum()
            total = total + cross_entropy(raw[frame, anchor, 5:], hot)
            foreground += len(anchor)
        total = total + cross_entropy(raw[frame, :, 4], objectness)
    return total / max(foreground, 1)


def cross_entropy(logits: Tensor, target: Tensor) -> Tensor:
    """Binary cross-entropy, summed."""
    return functional.binary_cross_entropy_with_logits(logits, target, reduction="sum")


def histogram(events: Sequence[Tensor], bins: int, height: int, width: int) -> Tensor:
    """Counts of t, x, y, p by one index per event and an accumulating scatter, cut off at 10."""
    t, x, y, p = events
    elapsed = (t - t[0]).float()
    number = (elapsed / elapsed[-1].clamp(min=1) * bins).floor().clamp(max=bins - 1).long()
    index = ((p.long() * bins + number) * height + y.long()) * width + x.long()
    counts = torch.zeros(2 * bins * height * width, dtype=torch.int16)
    counts.put_(index, torch.ones_like(index, dtype=torch.int16), accumulate=True)
    return counts.clamp_(max=10).to(torch.uint8).view(2 * bins, height, width)
