"""Multi-axis attention over partitions of a feature map, channels last."""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from eqs.models.dot_product import attend

NORM_EPS = 1e-5
LAYER_SCALE_INIT = 1e-5


# From the axes of `cells` to (batch, groups down, groups across, rows, columns, channels).
TO_GROUPS = {"window": (0, 1, 3, 2, 4, 5), "grid": (0, 2, 4, 1, 3, 5)}
FROM_GROUPS = {"window": (0, 1, 3, 2, 4, 5), "grid": (0, 3, 1, 4, 2, 5)}


def cells(x: Tensor, partition: tuple[int, int], kind: str) -> Tensor:
    """View (B, H, W, C) with H and W cut in two: the cut into windows, or into the grid."""
    batch, height, width, channels = x.shape
    a, b = partition
    if kind == "window":
        return x.view(batch, height // a, a, width // b, b, channels)
    return x.view(batch, a, height // a, b, width // b, channels)


class LayerScale(nn.Module):
    """A learned factor per channel, applied by `scaled_linear`."""

    def __init__(self, channels: int) -> None:
        """Start near zero, so that every branch starts near the identity."""
        super().__init__()
        self.gamma = nn.Parameter(torch.full((channels,), LAYER_SCALE_INIT))


def scaled_linear(x: Tensor, linear: nn.Linear, scale: LayerScale) -> Tensor:
    """`gamma * linear(x)`, with gamma folded into the weight: no pass over the tokens."""
    gamma = scale.gamma
    return functional.linear(x, gamma[:, None] * linear.weight, gamma * linear.bias)


class SelfAttention(nn.Module):
    """Multi-head self-attention whose projection carries the layer scale."""

    def __init__(self, channels: int, head_dim: int) -> None:
        """Make as many heads as `head_dim` goes into `channels`."""
        super().__init__()
        self.num_heads = channels // head_dim
        self.qkv = nn.Linear(channels, 3 * channels)
        self.proj = nn.Linear(channels, channels)

    def forward(self, x: Tensor, scale: LayerScale) -> Tensor:
        """Attend within each group of tokens, (groups, tokens, C) -> the same."""
        mixed = attend(self.qkv(x), self.num_heads)
        return scaled_linear(mixed, self.proj, scale)


class Mlp(nn.Module):
    """Linear, exact GELU, linear; four times as wide inside."""

    def __init__(self, channels: int) -> None:
        """Nest the layers as published parameter names ask."""
        super().__init__()
        self.net = nn.Sequential(
            nn.Sequential(nn.Linear(channels, 4 * channels), nn.GELU()),
            nn.Identity(),
            nn.Linear(4 * channels, channels),
        )

    def forward(self, x: Tensor, scale: LayerScale) -> Tensor:
        """Apply token by token; `scale` is folded into the last layer."""
        return scaled_linear(self.net[0](x), cast(nn.Linear, self.net[2]), scale)


class PartitionAttention(nn.Module):
    """A pre-norm transformer block that attends within windows or within a dilated grid.

    Convention: a window holds neighbouring tokens; a grid group holds tokens H/a rows and W/b
    columns apart. Both have a*b tokens.
    """

    def __init__(self, channels: int, head_dim: int, *, kind: str, first_norm: bool) -> None:
        """Build one block; without `first_norm` the input must be normalised already."""
        super().__init__()
        self.kind = kind
        self.norm1 = nn.LayerNorm(channels, eps=NORM_EPS) if first_norm else nn.Identity()
        self.self_attn = SelfAttention(channels, head_dim)
        self.ls1 = LayerScale(channels)
        self.norm2 = nn.LayerNorm(channels, eps=NORM_EPS)
        self.mlp = Mlp(channels)
        self.ls2 = LayerScale(channels)

    def forward(self, x: Tensor, partition: tuple[int, int]) -> Tensor:
        """Transform (B, H, W, C), whose H and W are multiples of the partition's sides."""
        spread = cells(x, partition, self.kind)
        grouped = spread.permute(TO_GROUPS[self.kind])
        tokens = self.norm1(grouped.reshape(-1, partition[0] * partition[1], x.shape[-1]))
        branch = self.self_attn(tokens, self.ls1).view(grouped.shape)
        # Scattering the branch back over the map happens inside the residual sum.
        x = (spread + branch.permute(FROM_GROUPS[self.kind])).view(x.shape)
        transformed: Tensor = x + self.mlp(self.norm2(x), self.ls2)
        return transformed
