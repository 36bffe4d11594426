"""The whole detector: recurrent backbone, feature pyramid, detection head."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor, nn

from eqs.models.attention import LAYER_SCALE_INIT, LayerScale
from eqs.models.backbone import STRIDES, RVTBackbone
from eqs.models.checkpoint import (
    STEM,
    check_entries,
    load_weights,
    partition_of,
    read_weights,
    shape_of,
)
from eqs.models.fpn import PAFPN
from eqs.models.loss import detection_loss
from eqs.models.lstm import ConvLSTM
from eqs.models.states import States
from eqs.models.yolox_head import YOLOXHead, decode_boxes


@dataclass(frozen=True, kw_only=True)
class RVTSize:
    """What distinguishes the published sizes."""

    embed_dim: int
    head_dim: int
    pyramid_depth: int


SIZES = {
    "tiny": RVTSize(embed_dim=32, head_dim=32, pyramid_depth=1),
    "small": RVTSize(embed_dim=48, head_dim=24, pyramid_depth=1),
    "base": RVTSize(embed_dim=64, head_dim=32, pyramid_depth=2),
}


class RVTDetector(nn.Module):
    """RVT with the YOLOX head (Gehrig and Scaramuzza, CVPR 2023), parameter names as published.

    Args:
        size: tiny (4.4 M parameters), small (9.9 M) or base (18.5 M).
        num_classes: classes of objects.
        in_channels: channels of the event tensor, twice its time bins.
        partition_split_32: inputs are padded to multiples of 32 times this, and attention groups
            cover one part in so many of each side of the coarsest map.
        weights: checkpoint to load strictly, None to start from random weights.
        new_class_branch: where `weights` knows another number of classes, start the layers that
            depend on it anew instead of failing.
        layer_scale_init: factor that every attention and MLP branch starts with; the published one
            is close to nothing, a larger one lets a short training use the branches at once.
        open_recurrence: start every recurrent cell so that it passes its input on.
        first_box_strides: width and height, in strides, of the boxes that every anchor starts
            with; None starts as published.

    Raises:
        ValueError: an unknown size, or weights that do not fit.
        FileNotFoundError: no file at `weights`.

    Example:
        >>> import torch
        >>> model = RVTDetector("tiny", num_classes=3).eval()
        >>> predictions, states = model(torch.zeros(1, 20, 64, 128), None)
        >>> predictions.shape, len(states)
        (torch.Size([1, 168, 8]), 4)
    """

    def __init__(
        self,
        size: str = "small",
        num_classes: int = 2,
        in_channels: int = 20,
        partition_split_32: int = 2,
        weights: str | Path | None = None,
        new_class_branch: bool = False,
        layer_scale_init: float = LAYER_SCALE_INIT,
        open_recurrence: bool = False,
        first_box_strides: tuple[float, float] | None = None,
    ) -> None:
        """Build the network, then load `weights` if there are any."""
        super().__init__()
        if size not in SIZES:
            raise ValueError(f"Expected one of {', '.join(SIZES)}, got {size!r}; set model.size")
        if min(num_classes, in_channels, partition_split_32) < 1:
            raise ValueError(
                "Expected positive num_classes, in_channels and partition_split_32, got "
                f"{num_classes}, {in_channels} and {partition_split_32}"
            )
        self.size = size
        self.num_classes = num_classes
        shape = SIZES[size]
        self.backbone = RVTBackbone(
            in_channels, shape.embed_dim, shape.head_dim, partition_split_32
        )
        widths = self.backbone.widths[1:]
        self.fpn = PAFPN(widths, shape.pyramid_depth)
        self.yolox_head = YOLOXHead(widths, num_classes)
        for module in self.modules():
            if isinstance(module, LayerScale):
                nn.init.constant_(module.gamma, layer_scale_init)
            elif isinstance(module, ConvLSTM) and open_recurrence:
                module.start_open()
        if first_box_strides is not None:
            self.yolox_head.start_from(first_box_strides)
        if weights is not None:
            load_weights(self, weights, new_class_branch=new_class_branch)

    @classmethod
    def from_checkpoint(
        cls,
        path: str | Path,
        num_classes: int | None = None,
        partition_split_32: int | None = None,
        new_class_branch: bool = False,
    ) -> RVTDetector:
        """Build the detector that a checkpoint's shapes describe and load it strictly.

        Args:
            path: a published Lightning checkpoint, one of ours, or a plain state dict.
            num_classes: classes wanted; None takes the checkpoint's.
            partition_split_32: as in the constructor; by default what the checkpoint knows, or 2.
            new_class_branch: start the class layers anew where `num_classes` differs.

        Raises:
            FileNotFoundError: no such file.
            ValueError: not a detector of a known size, missing or unexpected entries, another
                number of classes, or another partition than the checkpoint's.
        """
        found = shape_of(read_weights(path), path)
        return cls(
            size_of_width(found.embed_dim, path),
            num_classes=found.num_classes if num_classes is None else num_classes,
            in_channels=found.in_channels,
            partition_split_32=partition_of(path, partition_split_32),
            weights=path,
            new_class_branch=new_class_branch,
        )

    def compile_stages(self, backend: str = "inductor") -> None:
        """Have `torch.compile` translate every stage of the backbone; parameters keep their names.

        The first steps then take minutes; what it gains depends on the device.
        """
        for stage in self.backbone.stages:
            stage.compile(backend=backend)

    @property
    def partition_split_32(self) -> int:
        """Attention windows per side of the last stage, which checkpoints keep."""
        return self.backbone.partition_split_32

    def forward_sequence(
        self, histograms: Tensor, states: States | None = None
    ) -> tuple[list[Tensor], States]:
        """Features (T, N, C, h, w) of the four stages for T windows (T, N, in_channels, H, W)."""
        return self.backbone.forward_sequence(histograms, states)

    def forward(self, x: Tensor, states: States | None = None) -> tuple[Tensor, States]:
        """Detect in one time step.

        Args:
            x: event tensors (N, in_channels, H, W), any size, any real number type.
            states: what the step before returned, None at the start.

        Returns:
            Predictions (N, A, 5 + classes), columns cx, cy, w, h in pixels, objectness, class
            confidences; and the new states, (h, c) of each stage.
        """
        features, states = self.backbone(x, states)
        return self.detect(features), states

    def detect(self, features: Sequence[Tensor]) -> Tensor:
        """Predictions (F, A, 5 + classes) from the features of stages 1 to 4 or 2 to 4."""
        raw, anchors = self._head(features)
        return torch.cat((decode_boxes(raw, anchors), raw[..., 4:].float().sigmoid()), dim=-1)

    def loss(
        self, features: Sequence[Tensor], labels: Tensor, use_l1: bool = False
    ) -> dict[str, Tensor]:
        """Loss of F labelled frames; batch norm sees exactly these frames.

        Args:
            features: maps (F, C, h, w) of stages 1 to 4 or 2 to 4.
            labels: (F, M, 5) rows class, cx, cy, w, h in pixels; zero rows are padding.
            use_l1: add the L1 loss of raw box outputs (RVT does not).

        Returns:
            Scalars as `detection_loss` describes them.
        """
        if labels.ndim != 3 or labels.shape[-1] != 5 or len(labels) != len(features[-1]):
            raise ValueError(
                f"Expected labels ({len(features[-1])}, M, 5) with rows class, cx, cy, w, h, got "
                f"{tuple(labels.shape)}"
            )
        raw, anchors = self._head(features)
        with torch.autocast(raw.device.type, enabled=False):
            raw = raw.float()
            boxes = decode_boxes(raw, anchors)
            offsets = raw[..., :4] if use_l1 else None
            return detection_loss(boxes, raw[..., 4:], anchors, labels.float(), offsets)

    def _head(self, features: Sequence[Tensor]) -> tuple[Tensor, Tensor]:
        raw: Tensor
        anchors: Tensor
        raw, anchors = self.yolox_head(self.fpn(features[-3:]))
        return raw, anchors


def size_of_width(embed_dim: int, path: str | Path) -> str:
    """The published size with this embedding width.

    Raises:
        ValueError: there is none.
    """
    sizes = {shape.embed_dim: size for size, shape in SIZES.items()}
    if embed_dim not in sizes:
        raise ValueError(
            f"Expected a detector of embedding width {', '.join(map(str, sizes))}, got "
            f"{embed_dim} in {path}"
        )
    return sizes[embed_dim]


def backbone_from_checkpoint(
    path: str | Path, partition_split_32: int | None = None
) -> tuple[RVTBackbone, str]:
    """The backbone alone, loaded strictly, and its size.

    Args:
        path: checkpoint of a detector, or of a backbone under the detector's names.
        partition_split_32: as in the constructor; by default what the checkpoint knows, or 2.

    Raises:
        FileNotFoundError: no such file.
        ValueError: not a backbone of a known size, missing or unexpected entries, or another
            partition than the checkpoint's.
    """
    stem = "backbone."
    names = read_weights(path, "eqs.judge")
    weights = {name.removeprefix(stem): x for name, x in names.items() if name.startswith(stem)}
    embed_dim, in_channels = weights[STEM.removeprefix(stem)].shape[:2]
    size = size_of_width(embed_dim, path)
    partition = partition_of(path, partition_split_32, "eqs.judge")
    stages = stages_of(names)
    backbone = RVTBackbone(in_channels, embed_dim, SIZES[size].head_dim, partition, stages)
    check_entries(backbone.state_dict(), weights, path, "eqs.judge to another file")
    backbone.load_state_dict(weights)
    return backbone, size


def stages_of(names: Iterable[str]) -> int:
    """Stages of the backbone in a file; one with a head needs all four, one without may be cut.

    Example:
        >>> stages_of(["backbone.stages.0.lstm.conv.weight", "backbone.stages.1.lstm.conv.weight"])
        2
    """
    parts = [name.split(".") for name in names]
    if any(part[0] != "backbone" for part in parts):
        return len(STRIDES)
    return min(len(STRIDES), 1 + max(int(part[2]) for part in parts if part[1] == "stages"))


def cut_to(backbone: RVTBackbone, stages: int) -> tuple[RVTBackbone, str]:
    """The first stages of a backbone in evaluation mode, weights rounded to half precision.

    What these stages compute depends on no later one.

    Returns:
        The new backbone, frozen and in float32, and the name of its size.
    """
    embed_dim = backbone.widths[0]
    size = size_of_width(embed_dim, "memory")
    cut = RVTBackbone(
        backbone.in_channels, embed_dim, SIZES[size].head_dim, backbone.partition_split_32, stages
    )
    kept = cut.state_dict().keys()
    cut.load_state_dict(
        {name: x.half().float() for name, x in backbone.state_dict().items() if name in kept}
    )
    return cut.eval().requires_grad_(False), size
