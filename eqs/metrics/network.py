"""The network of a judge: its shape, its weights, the hash of both."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import nn

from eqs.models import RVTBackbone, RVTDetector, backbone_from_checkpoint


@dataclass(frozen=True, kw_only=True)
class RVTShape:
    """What a file of RVT's weights does not say, or not by itself, about their network.

    Args:
        size: tiny, small or base.
        bins: time bins per polarity, half the input channels.
        partition_split_32: attention windows per side of the backbone's last stage.
    """

    size: str = "small"
    bins: int = 10
    partition_split_32: int = 2

    @property
    def architecture(self) -> str:
        """The name that a definition knows it by."""
        return f"rvt-{self.size}-split{self.partition_split_32}"


def untrained_backbone(shape: RVTShape, seed: int = 0) -> RVTBackbone:
    """A frozen backbone that learnt nothing; the same seed gives the same weights."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        model = RVTDetector(
            size=shape.size,
            in_channels=2 * shape.bins,
            partition_split_32=shape.partition_split_32,
        )
    return model.backbone.eval().requires_grad_(False)


def trained_backbone(
    path: Path | str, partition_split_32: int | None
) -> tuple[RVTBackbone, RVTShape]:
    """The frozen backbone of a checkpoint, and its shape.

    Args:
        path: checkpoint of a detector, or of a backbone under the detector's names.
        partition_split_32: as it was trained; None for what the file knows, or else 2.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file holds no backbone of a known size, or one of another partition.
    """
    backbone, size = backbone_from_checkpoint(path, partition_split_32)
    bins = backbone.in_channels // 2
    shape = RVTShape(size=size, bins=bins, partition_split_32=backbone.partition_split_32)
    return backbone.eval().requires_grad_(False), shape


def weights_sha256(module: nn.Module) -> str:
    """The sha256 of a module's named tensors, whatever file they came in.

    Convention: it covers names, shapes, types and values in the order of the names.
    """
    digest = hashlib.sha256()
    for name, tensor in sorted(module.state_dict().items()):
        data = tensor.detach().cpu().contiguous()
        digest.update(f"{name} {tuple(data.shape)} {data.dtype}".encode())
        digest.update(data.reshape(-1).view(torch.uint8).numpy().tobytes())
    return digest.hexdigest()
