"""The network of a judge: what builds it again, its weights, their hash."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from torch import nn

from eqs.files import short_hash
from eqs.metrics.features import require_network
from eqs.models import RVTBackbone, RVTDetector, backbone_from_checkpoint
from eqs.models.checkpoint import GEOMETRY, load_trained
from eqs.models.settings import TARGET, built, class_of

KEY = "eqs.judge"


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

    def untrained(self, seed: int = 0) -> RVTBackbone:
        """A frozen backbone that learnt nothing; the same seed gives the same weights."""
        with _drawn_from(seed):
            model = RVTDetector(
                size=self.size,
                in_channels=2 * self.bins,
                partition_split_32=self.partition_split_32,
            )
        return model.backbone.eval().requires_grad_(False)

    def trained(self, path: Path | str) -> RVTBackbone:
        """The frozen backbone with the weights of a file."""
        return trained_backbone(path, self.partition_split_32)[0]

    def entries(self, backbone: nn.Module) -> dict[str, Any]:
        """What a file of its weights holds."""
        named = backbone.state_dict().items()
        weights = {f"backbone.{name}": halved(x.cpu()) for name, x in named}
        return {**weights, GEOMETRY: self.partition_split_32}

    def record(self) -> dict[str, Any]:
        """Plain values that `network_of` reads."""
        return asdict(self)


@dataclass(frozen=True, kw_only=True)
class OwnNetwork:
    """What builds a network of somebody's own.

    Args:
        settings: keyword arguments, with the dotted name of its class as `_target_`.

    Raises:
        ValueError: there is no such class here.
    """

    settings: Mapping[str, Any]

    def __post_init__(self) -> None:
        """Look the class up, so that what is missing is missed before the work."""
        class_of(self.settings, KEY)

    @property
    def architecture(self) -> str:
        """The name that a definition knows it by: its settings change what it computes."""
        return f"{self.settings[TARGET].rpartition('.')[2]}-{short_hash(dict(self.settings))}"

    def build(self, seed: int = 0) -> nn.Module:
        """The frozen network as its class makes it; what it draws depends on the seed alone.

        Raises:
            ValueError: the class does not take these settings, or the network cannot judge.
        """
        with _drawn_from(seed):
            network = built(self.settings, KEY)
        require_network(network)
        return network.eval().requires_grad_(False)

    def untrained(self, seed: int = 0) -> nn.Module:
        """The network with every layer that has `reset_parameters` started anew."""
        network = self.build(seed)
        with _drawn_from(seed):
            for module in network.modules():
                if callable(reset := getattr(module, "reset_parameters", None)):
                    reset()
        return network

    def trained(self, path: Path | str) -> nn.Module:
        """The frozen network with the weights of a file."""
        network = self.build()
        load_trained(network, path, KEY)
        return network

    def entries(self, backbone: nn.Module) -> dict[str, Any]:
        """What a file of its weights holds."""
        return {name: x.cpu() for name, x in backbone.state_dict().items()}

    def record(self) -> dict[str, Any]:
        """Plain values that `network_of` reads."""
        return dict(self.settings)


def halved(x: torch.Tensor) -> torch.Tensor:
    """The same values in half precision, where that holds all of them."""
    half = x.half()
    return half if torch.equal(half.float(), x) else x


Network = RVTShape | OwnNetwork


def network_of(record: Mapping[str, Any]) -> Network:
    """What builds the network that `record` wrote down."""
    return OwnNetwork(settings=record) if TARGET in record else RVTShape(**record)


@contextmanager
def _drawn_from(seed: int) -> Iterator[None]:
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        yield


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
