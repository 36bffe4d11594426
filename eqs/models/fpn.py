"""The feature pyramid: PAFPN of YOLOX, top-down and bottom-up."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional


class ConvNormAct(nn.Module):
    """Convolution without bias, batch norm (PyTorch's own eps and momentum), SiLU."""

    def __init__(self, in_channels: int, channels: int, kernel: int = 1, stride: int = 1) -> None:
        """Pad so that stride 1 keeps the size."""
        super().__init__()
        self.conv = nn.Conv2d(in_channels, channels, kernel, stride, (kernel - 1) // 2, bias=False)
        self.bn = nn.BatchNorm2d(channels)

    def forward(self, x: Tensor) -> Tensor:
        """Map (B, in_channels, H, W) to (B, channels, H/stride, W/stride)."""
        return functional.silu(self.bn(self.conv(x)), inplace=True)


class Bottleneck(nn.Module):
    """A 1x1 and a 3x3 convolution, without shortcut."""

    def __init__(self, channels: int) -> None:
        """Keep the number of channels."""
        super().__init__()
        self.conv1 = ConvNormAct(channels, channels, 1)
        self.conv2 = ConvNormAct(channels, channels, 3)

    def forward(self, x: Tensor) -> Tensor:
        """Keep the shape."""
        mapped: Tensor = self.conv2(self.conv1(x))
        return mapped


class CSPLayer(nn.Module):
    """Half of the channels pass through bottlenecks, half pass by."""

    def __init__(self, in_channels: int, channels: int, depth: int) -> None:
        """Stack `depth` bottlenecks."""
        super().__init__()
        hidden = channels // 2
        self.conv1 = ConvNormAct(in_channels, hidden)
        self.conv2 = ConvNormAct(in_channels, hidden)
        self.conv3 = ConvNormAct(2 * hidden, channels)
        self.m = nn.Sequential(*(Bottleneck(hidden) for _ in range(depth)))

    def forward(self, x: Tensor) -> Tensor:
        """Map (B, in_channels, H, W) to (B, channels, H, W)."""
        mapped: Tensor = self.conv3(torch.cat((self.m(self.conv1(x)), self.conv2(x)), dim=1))
        return mapped


class PAFPN(nn.Module):
    """Mixes the last three backbone stages; output widths equal input widths."""

    def __init__(self, widths: Sequence[int], depth: int) -> None:
        """Build for stages of these three widths."""
        super().__init__()
        low, middle, high = widths
        self.lateral_conv0 = ConvNormAct(high, middle)
        self.C3_p4 = CSPLayer(2 * middle, middle, depth)
        self.reduce_conv1 = ConvNormAct(middle, low)
        self.C3_p3 = CSPLayer(2 * low, low, depth)
        self.bu_conv2 = ConvNormAct(low, low, 3, 2)
        self.C3_n3 = CSPLayer(2 * low, middle, depth)
        self.bu_conv1 = ConvNormAct(middle, middle, 3, 2)
        self.C3_n4 = CSPLayer(2 * middle, high, depth)

    def forward(self, features: Sequence[Tensor]) -> list[Tensor]:
        """Map stages 2, 3, 4, strides 8, 16, 32, to three maps of the same shapes."""
        low, middle, high = features
        top = self.lateral_conv0(high)
        middle = self.C3_p4(torch.cat((_twice(top), middle), dim=1))
        between = self.reduce_conv1(middle)
        level3 = self.C3_p3(torch.cat((_twice(between), low), dim=1))
        level4 = self.C3_n3(torch.cat((self.bu_conv2(level3), between), dim=1))
        level5 = self.C3_n4(torch.cat((self.bu_conv1(level4), top), dim=1))
        return [level3, level4, level5]


def _twice(x: Tensor) -> Tensor:
    return functional.interpolate(x, scale_factor=2, mode="nearest")
