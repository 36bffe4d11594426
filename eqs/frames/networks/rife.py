"""RIFE 4.25: flow and blending mask, refined in five steps from coarse to fine.

Huang et al., "Real-Time Intermediate Flow Estimation for Video Frame Interpolation", ECCV 2022;
this version's layout is known from its published weights.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn import functional

from eqs.frames.networks.planes import Between, on_frames, warped
from eqs.frames.networks.weights import filled, plain

RECOGNISED_BY = "block0.conv0.0.0.weight"
TRAINING_ONLY = ("caltime.", "teacher.")
FIRST_CHANNELS = 15  # two frames, two times four features, the share
LATER_CHANNELS = 28  # the same, and the mask, eight features and the flow of the block before
STEPS = ((192, 16), (128, 8), (96, 4), (64, 2), (32, 1))  # width of each block, and its scale
STILL_PX, SAME_LEVELS = 0.5, 1.0  # what counts as no flow and as no change; see `blended`


class Features(nn.Module):
    """Four feature planes of a frame."""

    def __init__(self) -> None:
        """Lay out the convolutions."""
        super().__init__()
        self.cnn0 = nn.Conv2d(3, 16, 3, stride=2, padding=1)
        self.cnn1 = nn.Conv2d(16, 16, 3, padding=1)
        self.cnn2 = nn.Conv2d(16, 16, 3, padding=1)
        self.cnn3 = nn.ConvTranspose2d(16, 4, 4, stride=2, padding=1)

    def forward(self, frame: Tensor) -> Tensor:
        """Of a frame (N, 3, H, W), planes (N, 4, H, W)."""
        planes = rectified(self.cnn1(rectified(self.cnn0(frame))))
        made: Tensor = self.cnn3(rectified(self.cnn2(planes)))
        return made


class Residual(nn.Module):
    """A convolution, scaled, added to what it saw."""

    def __init__(self, width: int) -> None:
        """Lay out the convolution and its scale."""
        super().__init__()
        self.beta = nn.Parameter(torch.ones(1, width, 1, 1))
        self.conv = nn.Conv2d(width, width, 3, padding=1)

    def forward(self, planes: Tensor) -> Tensor:
        """Of planes (N, width, H, W)."""
        return rectified(self.conv(planes) * self.beta + planes)


class Block(nn.Module):
    """One refinement at one scale.

    Args:
        taken: channels in.
        width: channels within.
        scale: how many times coarser than the frames it looks.
    """

    def __init__(self, taken: int, width: int, scale: int) -> None:
        """Lay out the convolutions, under the names that the weights have."""
        super().__init__()
        self.scale = scale
        self.conv0 = nn.Sequential(
            *(
                nn.Sequential(nn.Conv2d(channels, made, 3, stride=2, padding=1), nn.LeakyReLU(0.2))
                for channels, made in ((taken, width // 2), (width // 2, width))
            )
        )
        self.convblock = nn.Sequential(*(Residual(width) for _ in range(8)))
        enlarged = nn.ConvTranspose2d(width, 4 * 13, 4, stride=2, padding=1)
        self.lastconv = nn.Sequential(enlarged, nn.PixelShuffle(2))

    def forward(self, seen: Tensor, flow: Tensor | None) -> tuple[Tensor, Tensor, Tensor]:
        """Flow to be added (N, 4, H, W), mask (N, 1, H, W), features (N, 8, H, W)."""
        planes = resized(seen, 1 / self.scale)
        if flow is not None:
            planes = torch.cat([planes, resized(flow, 1 / self.scale) / self.scale], dim=1)
        planes = self.lastconv(self.convblock(self.conv0(planes)))
        more, mask, features = resized(planes, self.scale).split([4, 1, 8], dim=1)
        return more * self.scale, mask, features


class Rife(nn.Module):
    """The whole network."""

    def __init__(self) -> None:
        """Lay out the blocks, under the names that the weights have."""
        super().__init__()
        for index, (width, scale) in enumerate(STEPS):
            taken = LATER_CHANNELS if index else FIRST_CHANNELS
            self.add_module(f"block{index}", Block(taken, width, scale))
        self.encode = Features()

    def forward(
        self, pair: tuple[Tensor, Tensor], features: tuple[Tensor, Tensor], share: float
    ) -> tuple[Tensor, Tensor]:
        """Flows to the first and the second frame (N, 4, H, W), and the first's weight's logit."""
        at = pair[0].new_full((len(pair[0]), 1, *pair[0].shape[2:]), share)
        flow, mask, kept = self.get_submodule("block0")(
            torch.cat([*pair, *features, at], dim=1), None
        )
        for index in range(1, len(STEPS)):
            to = flow.split(2, dim=1)
            moved = [warped(x, to[k % 2]) for k, x in enumerate((*pair, *features))]
            seen = torch.cat([*moved, at, mask, kept], dim=1)
            more, mask, kept = self.get_submodule(f"block{index}")(seen, flow)
            flow = flow + more
        return flow, mask

    def between(self, first: Tensor, second: Tensor, shares: Sequence[float]) -> Iterator[Tensor]:
        """See `planes.Network`; the features of a pair are found once."""
        pair = first, second
        features = self.encode(first), self.encode(second)
        for share in shares:
            flow, mask = self(pair, features, share)
            yield blended(pair, flow, mask, share)


def blended(pair: tuple[Tensor, Tensor], flow: Tensor, mask: Tensor, share: float) -> Tensor:
    """The moved frames, weighed by the mask where something moves and by time where nothing does.

    RIFE's mask does not follow the time: between two flat frames of 100 and 200 it gives 103, 134
    and 190 at a quarter, half and three quarters, so that still pixels under changing light would
    fire at wrong times. Ours: what stays where it is is cross-faded, (1 - t) first + t second. That
    is a pixel whose flow is below `STILL_PX`, or one that reads the same to `SAME_LEVELS` where the
    flow points as where it is: where nothing is to be seen RIFE finds flows of many pixels, which
    mean nothing. Up to twice either bound this passes over into RIFE's blend, so that no edge
    appears between the two.

    Convention: the flow that counts is the displacement between the frames, the difference of the
    flows to both; each of these alone goes to zero at one end.
    """
    to_first, to_second = flow.split(2, dim=1)
    moved = warped(pair[0], to_first), warped(pair[1], to_second)
    displacement_px = torch.linalg.vector_norm(to_second - to_first, dim=1, keepdim=True)
    changes = [(a - b).abs().amax(dim=1, keepdim=True) for a, b in zip(moved, pair, strict=True)]
    still = torch.maximum(
        below(displacement_px, STILL_PX), below(torch.maximum(*changes), SAME_LEVELS / 255)
    )
    weight = torch.sigmoid(mask)
    blend = weight * moved[0] + (1 - weight) * moved[1]
    return torch.lerp(blend, (1 - share) * pair[0] + share * pair[1], still)


def below(values: Tensor, bound: float) -> Tensor:
    """One up to a bound, zero from twice the bound on, a line between.

    Example:
        >>> below(torch.tensor([0.0, 0.5, 0.75, 1.0, 9.0]), 0.5).tolist()
        [1.0, 1.0, 0.5, 0.0, 0.0]
    """
    return (2 - values / bound).clamp(0, 1)


def resized(planes: Tensor, factor: float) -> Tensor:
    """Planes with both sides times a factor, bilinear."""
    if factor == 1:
        return planes
    return functional.interpolate(planes, scale_factor=factor, mode="bilinear", align_corners=False)


def rectified(planes: Tensor) -> Tensor:
    """What lies below zero reduced to a fifth."""
    return functional.leaky_relu(planes, 0.2)


def is_rife(content: object) -> bool:
    """Whether a file's content is laid out as the weights of any RIFE are."""
    return RECOGNISED_BY in plain(content)


def needed_weights(content: object) -> dict[str, Tensor]:
    """The weights that make frames, without those that served training."""
    return {k: v for k, v in plain(content).items() if not k.startswith(TRAINING_ONLY)}


def rife_of(content: object, path: Path) -> Between:
    """The network of a file of weights.

    Raises:
        ValueError: they are another version's.
    """
    weights = needed_weights(content)
    try:
        network = filled(Rife, weights)
    except ValueError as error:
        blocks = len({name.partition(".")[0] for name in weights if name.startswith("block")})
        channels = weights[RECOGNISED_BY].shape[1:2]
        raise ValueError(
            f"Expected the weights of RIFE 4.25, the version supported here: {len(STEPS)} blocks, "
            f"the first on {FIRST_CHANNELS} channels; got {blocks}, the first on {list(channels)}, "
            f"in {path} ({error}); eqs fetch-interpolator rife gets the right ones"
        ) from error
    return on_frames(network.between, 3)
