"""Networks that give the events between two frames as expected counts, and that judge them.

After Zhu, Wang, Khant and Daniilidis, "EventGAN: Leveraging Large Scale Image Datasets for Event
Cameras", ICCP 2021: a U-Net that gives an event volume, and a critic of patches. What is ours: it
sees the log light of both frames, their difference and noise; it gives expected counts in equal
bins instead of a normalised volume, so that numbers of events come out right; and it normalises
across channels alone, so that a pixel depends on its surroundings but not on the size of the image.
"""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn import functional
from torch.nn.utils.parametrizations import spectral_norm

BINS = 10
REACH = 16
"""Images are padded to multiples of this, the scale of the smallest feature map."""
DIFFERENCE_SCALE = 4.0
FIRST_BIAS = -3.0  # softplus then gives 0.05 events a voxel, about the mean of street scenes


def generator_input(first: Tensor, second: Tensor, noise: Tensor) -> Tensor:
    """What the generator sees.

    Args:
        first: grey levels 0..255 of the earlier frame, shape (N, H, W).
        second: those of the later frame.
        noise: standard normal numbers of the same shape.

    Returns:
        Log light of both, their difference and the noise, shape (N, 4, H, W).

    Example:
        >>> flat = torch.full((1, 2, 2), 255.0)
        >>> generator_input(flat, flat, 0 * flat)[0, :, 0, 0].tolist()
        [2.0, 2.0, 0.0, 0.0]
    """
    logs = [torch.log((levels + 4.0) / 259.0) for levels in (first, second)]
    change = DIFFERENCE_SCALE * (logs[1] - logs[0])
    return torch.stack([logs[0] + 2.0, logs[1] + 2.0, change, noise], dim=1)


class AcrossChannels(nn.Module):
    """Scales the features of each pixel to unit mean square, then each channel by a weight."""

    def __init__(self, channels: int) -> None:
        """Start without changing the scale."""
        super().__init__()
        self.weight = nn.Parameter(torch.ones(channels, 1, 1))
        self.bias = nn.Parameter(torch.zeros(channels, 1, 1))

    def forward(self, features: Tensor) -> Tensor:
        """Normalised features, of the same shape (N, C, H, W)."""
        power = features.square().mean(dim=1, keepdim=True)
        return features * torch.rsqrt(power + 1e-4) * self.weight + self.bias


def _block(channels_in: int, channels: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(channels_in, channels, 3, stride, padding=1),
        AcrossChannels(channels),
        nn.LeakyReLU(0.1),
    )


class VolumeGenerator(nn.Module):
    """A U-Net from two frames to expected counts of events.

    Args:
        width: channels at full size.
    """

    def __init__(self, width: int = 16) -> None:
        """Make the layers; they start near the mean of street scenes."""
        super().__init__()
        c = width
        widths = [c, 2 * c, 3 * c, 4 * c, 4 * c]
        self.head = _block(4, c)
        self.down = nn.ModuleList(
            nn.Sequential(_block(a, b, stride=2), _block(b, b)) for a, b in pairwise(widths)
        )
        self.up = nn.ModuleList(
            _block(low + skip, out)
            for low, skip, out in zip(
                (4 * c, 4 * c, 3 * c, 2 * c), widths[-2::-1], (4 * c, 3 * c, 2 * c, c), strict=True
            )
        )
        self.last = nn.Conv2d(c, 2 * BINS, 1)
        nn.init.constant_(self.last.bias, FIRST_BIAS)  # type: ignore[arg-type]

    def forward(self, seen: Tensor) -> Tensor:
        """Expected counts, OFF before ON, of what `generator_input` gives.

        Args:
            seen: shape (N, 4, H, W), of any size.

        Returns:
            Shape (N, 20, H, W): channel `p * 10 + bin`.
        """
        height, width = seen.shape[-2:]
        padding = (0, -width % REACH, 0, -height % REACH)
        features = self.head(functional.pad(seen, padding, mode="replicate"))
        skips = []
        for down in self.down:
            skips.append(features)
            features = down(features)
        for up in self.up:
            larger = functional.interpolate(features, scale_factor=2.0, mode="nearest")
            features = up(torch.cat([larger, skips.pop()], dim=1))
        counts: Tensor = functional.softplus(self.last(features))
        return counts[..., :height, :width]


class VolumeCritic(nn.Module):
    """Tells volumes of whole events from those that a generator made, patch by patch."""

    def __init__(self) -> None:
        """Make the layers, all of spectral norm 1."""
        super().__init__()
        layers: list[nn.Module] = []
        channels = 2 * BINS + 4
        for width in (32, 64, 128):
            convolution = nn.Conv2d(channels, width, 4, stride=2, padding=1)
            layers += [spectral_norm(convolution), nn.LeakyReLU(0.2)]
            channels = width
        self.layers = nn.Sequential(*layers, spectral_norm(nn.Conv2d(channels, 1, 3, padding=1)))

    def forward(self, counts: Tensor, seen: Tensor) -> Tensor:
        """A score for each patch, high where it takes the events for real.

        Args:
            counts: numbers of events, shape (N, 20, H, W); their roots vary evenly.
            seen: what the generator saw, shape (N, 4, H, W).
        """
        scores: Tensor = self.layers(torch.cat([torch.sqrt(counts + 1e-3), seen], dim=1))
        return scores
