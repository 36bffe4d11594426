"""Super SloMo: flows from one network, corrected and weighed by a second.

Jiang et al., "Super SloMo: High Quality Estimation of Multiple Intermediate Frames for Video
Interpolation", CVPR 2018; the layout of weights is that of v2e, Vid2E and Prophesee.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from eqs.frames.networks.planes import Between, on_frames, warped
from eqs.frames.networks.weights import filled, plain

FLOWS, FRAMES = "state_dictFC", "state_dictAT"  # names of the two networks in a checkpoint
MEANS = {1: (0.428,), 3: (0.429, 0.431, 0.397)}  # of the training frames, by planes a frame
DOWN = ((32, 64, 5), (64, 128, 3), (128, 256, 3), (256, 512, 3), (512, 512, 3))
UP = ((512, 512), (512, 256), (256, 128), (128, 64), (64, 32))


class Halves(nn.Module):
    """Halves both sides, then two convolutions."""

    def __init__(self, taken: int, made: int, side: int) -> None:
        """Lay out the convolutions."""
        super().__init__()
        self.conv1 = nn.Conv2d(taken, made, side, padding=side // 2)
        self.conv2 = nn.Conv2d(made, made, side, padding=side // 2)

    def forward(self, seen: Tensor) -> Tensor:
        """Of planes (N, C, H, W)."""
        return rectified(self.conv2(rectified(self.conv1(functional.avg_pool2d(seen, 2)))))


class Doubles(nn.Module):
    """Doubles both sides, then two convolutions, the second with what was seen at that size."""

    def __init__(self, taken: int, made: int) -> None:
        """Lay out the convolutions."""
        super().__init__()
        self.conv1 = nn.Conv2d(taken, made, 3, padding=1)
        self.conv2 = nn.Conv2d(2 * made, made, 3, padding=1)

    def forward(self, seen: Tensor, before: Tensor) -> Tensor:
        """Of planes (N, C, H, W) and those before the halving, (N, C', 2H, 2W).

        Convention: corners are not aligned here, as when the weights were trained.
        """
        larger = functional.interpolate(seen, scale_factor=2, mode="bilinear", align_corners=False)
        return rectified(self.conv2(torch.cat([rectified(self.conv1(larger)), before], dim=1)))


class UNet(nn.Module):
    """Five halvings and back; the last convolution is rectified like all others.

    Args:
        taken: channels in.
        made: channels out.
    """

    def __init__(self, taken: int, made: int) -> None:
        """Lay out the levels, under the names that checkpoints give them."""
        super().__init__()
        self.conv1 = nn.Conv2d(taken, 32, 7, padding=3)
        self.conv2 = nn.Conv2d(32, 32, 7, padding=3)
        for level, sizes in enumerate(DOWN, start=1):
            self.add_module(f"down{level}", Halves(*sizes))
        for level, channels in enumerate(UP, start=1):
            self.add_module(f"up{level}", Doubles(*channels))
        self.conv3 = nn.Conv2d(32, made, 3, padding=1)

    def forward(self, seen: Tensor) -> Tensor:
        """Of planes (N, C, H, W), sides multiples of 32."""
        levels = [rectified(self.conv2(rectified(self.conv1(seen))))]
        for level in range(1, 6):
            levels.append(self.get_submodule(f"down{level}")(levels[-1]))
        made = levels.pop()
        for level in range(1, 6):
            made = self.get_submodule(f"up{level}")(made, levels.pop())
        return rectified(self.conv3(made))


class SuperSloMo(NamedTuple):
    """The two networks and the mean of the frames that they were trained on.

    Args:
        flows: of both frames, the flow from the first to the second and back.
        frames: of frames, flows and moved frames, corrections to the flows and the visibility.
        mean: per plane, shape (1, C, 1, 1).
    """

    flows: nn.Module
    frames: nn.Module
    mean: Tensor

    def between(self, first: Tensor, second: Tensor, shares: Sequence[float]) -> Iterator[Tensor]:
        """See `planes.Network`; the flows of a pair are found once."""
        pair = first - self.mean, second - self.mean
        forward, backward = self.flows(torch.cat(pair, dim=1)).split(2, dim=1)
        for share in shares:
            yield self._at(pair, (forward, backward), share) + self.mean

    def _at(self, pair: tuple[Tensor, Tensor], flows: tuple[Tensor, Tensor], t: float) -> Tensor:
        """The frame at a share of the way; source: equations 1, 4 and 5 of the paper."""
        (first, second), (forward, backward) = pair, flows
        to_first = -(1 - t) * t * forward + t**2 * backward
        to_second = (1 - t) ** 2 * forward - t * (1 - t) * backward
        moved = warped(second, to_second), warped(first, to_first)
        seen = torch.cat([first, second, forward, backward, to_second, to_first, *moved], dim=1)
        more_to_first, more_to_second, logit = self.frames(seen).split([2, 2, 1], dim=1)
        visible = torch.sigmoid(logit)
        weights = (1 - t) * visible, t * (1 - visible)
        parts = warped(first, to_first + more_to_first), warped(second, to_second + more_to_second)
        total: Tensor = weights[0] * parts[0] + weights[1] * parts[1]
        return total / (weights[0] + weights[1])


def rectified(planes: Tensor) -> Tensor:
    """What lies below zero reduced to a tenth."""
    return functional.leaky_relu(planes, 0.1)


def is_super_slomo(content: object) -> bool:
    """Whether a file's content is laid out as Super SloMo's checkpoints are."""
    return isinstance(content, Mapping) and {FLOWS, FRAMES} <= content.keys()


def super_slomo_of(content: Mapping[str, object], path: Path) -> Between:
    """The network of a checkpoint, of grey frames or of colour as the shapes say.

    Raises:
        ValueError: names or shapes are not Super SloMo's.
    """
    flows, frames = plain(content[FLOWS]), plain(content[FRAMES])
    first = flows.get("conv1.weight")
    planes = first.shape[1] // 2 if first is not None and first.ndim == 4 else 0
    if planes not in MEANS:
        raise ValueError(
            "Expected a Super SloMo checkpoint for frames of one or three planes, got one whose "
            f"conv1.weight in {FLOWS} is {None if first is None else tuple(first.shape)} in {path}"
        )
    try:
        network = SuperSloMo(
            flows=filled(lambda: UNet(2 * planes, 4), flows),
            frames=filled(lambda: UNet(4 * planes + 8, 5), frames),
            mean=torch.tensor(MEANS[planes])[None, :, None, None],
        )
    except ValueError as error:
        raise ValueError(f"{error}; it is no Super SloMo checkpoint: {path}") from error
    return on_frames(network.between, planes)
