"""The decoupled, anchor-free detection head of YOLOX."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import cast

import torch
from torch import Tensor, nn

from eqs.models.fpn import ConvNormAct

STRIDES = (8, 16, 32)
PRIOR = 0.01


class YOLOXHead(nn.Module):
    """Three levels, each with a stem, a class branch and a box branch."""

    def __init__(self, widths: Sequence[int], num_classes: int) -> None:
        """Build for pyramid levels of these widths; the branches are a quarter of the last."""
        super().__init__()
        width = widths[-1] // 4
        self.num_classes = num_classes
        self.cls_convs = nn.ModuleList(_branch(width) for _ in widths)
        self.reg_convs = nn.ModuleList(_branch(width) for _ in widths)
        self.cls_preds = nn.ModuleList(nn.Conv2d(width, num_classes, 1) for _ in widths)
        self.reg_preds = nn.ModuleList(nn.Conv2d(width, 4, 1) for _ in widths)
        self.obj_preds = nn.ModuleList(nn.Conv2d(width, 1, 1) for _ in widths)
        self.stems = nn.ModuleList(ConvNormAct(channels, width) for channels in widths)
        for layer in (*self.cls_preds, *self.obj_preds):
            nn.init.constant_(layer.bias, -math.log((1 - PRIOR) / PRIOR))

    @torch.no_grad()
    def start_from(self, box_strides: tuple[float, float]) -> None:
        """Begin with boxes of this width and height, in strides, in the middle of their cells.

        With biases of zero they begin as squares of one stride around a corner of the cell, and
        most of a small object's first candidates hardly overlap it.
        """
        width, height = box_strides
        for layer in self.reg_preds:
            start = torch.tensor([0.5, 0.5, math.log(width), math.log(height)])
            cast(Tensor, layer.bias).copy_(start)

    def forward(self, levels: Sequence[Tensor]) -> tuple[Tensor, Tensor]:
        """Predict for every anchor of every level.

        Returns:
            Raw outputs (F, A, 5 + classes), columns tx, ty, tw, th, objectness logit, class
            logits, level by level, row-major; and the anchors (A, 3), columns grid column, grid
            row, stride.
        """
        outputs = [self._level(k, level) for k, level in enumerate(levels)]
        shapes = tuple((level.shape[-2], level.shape[-1]) for level in levels)
        return torch.cat(outputs, dim=1), anchor_grid(shapes, STRIDES, outputs[0].device)

    def _level(self, k: int, level: Tensor) -> Tensor:
        stem = self.stems[k](level)
        boxes = self.reg_convs[k](stem)
        parts = (
            self.reg_preds[k](boxes),
            self.obj_preds[k](boxes),
            self.cls_preds[k](self.cls_convs[k](stem)),
        )
        # Channels-last memory makes this reshape free of copies beyond the concatenation.
        return torch.cat([x.permute(0, 2, 3, 1) for x in parts], dim=-1).flatten(1, 2)


def _branch(width: int) -> nn.Sequential:
    return nn.Sequential(ConvNormAct(width, width, 3), ConvNormAct(width, width, 3))


def anchor_grid(
    shapes: tuple[tuple[int, int], ...], strides: tuple[int, ...], device: torch.device
) -> Tensor:
    """Anchors (A, 3) of levels of these (height, width): grid column, grid row, stride.

    They are made for every call: one that is kept from `torch.inference_mode` cannot be trained
    with afterwards.
    """
    levels = []
    for (height, width), stride in zip(shapes, strides, strict=True):
        rows = torch.arange(height, device=device).repeat_interleave(width)
        columns = torch.arange(width, device=device).repeat(height)
        levels.append(torch.stack((columns, rows, torch.full_like(rows, stride)), dim=1))
    return torch.cat(levels).float()


def decode_boxes(raw: Tensor, anchors: Tensor) -> Tensor:
    """Boxes (..., A, 4) as cx, cy, w, h in pixels, float32, from raw outputs (..., A, >=4).

    Convention: offsets count from the anchor's corner, with no half added; boxes are not clipped
    to the frame.
    """
    stride = anchors[:, 2:]
    raw = raw[..., :4].float()
    centres = (raw[..., :2] + anchors[:, :2]) * stride
    return torch.cat((centres, raw[..., 2:].exp() * stride), dim=-1)
