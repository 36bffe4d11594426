"""The recurrent vision transformer backbone of RVT (Gehrig and Scaramuzza, CVPR 2023)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple, cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from eqs.models.attention import NORM_EPS, PartitionAttention
from eqs.models.lstm import ConvLSTM, State, compute_dtype
from eqs.models.states import States

STRIDES = (4, 8, 16, 32)
CACHED_VALUES = 1 << 21  # of a stage's map, 8 MB in float32
TAPS = (
    "conv",
    "downsample",
    "window",
    "attention",
    "forget_gate",
    "input_gate",
    "gate",
    "gate_logits",
    "candidate",
    "hidden",
    "cell",
)


class Trace(NamedTuple):
    """What one stage computed, channels last; everything that can be tapped derives from it."""

    conv: Tensor
    downsample: Tensor
    window: Tensor
    attention: Tensor
    hidden: Tensor
    cell: Tensor


class Downsample(nn.Module):
    """Overlapping strided convolution and a norm over channels; the result is channels last."""

    def __init__(self, in_channels: int, channels: int, stride: int) -> None:
        """Overlap neighbouring patches by about half."""
        super().__init__()
        kernel = 2 * (stride - 1) + 1
        self.conv = nn.Conv2d(in_channels, channels, kernel, stride, kernel // 2, bias=False)
        self.norm = nn.LayerNorm(channels, eps=NORM_EPS)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Map (B, C, H, W) to the convolved and to the normalised (B, h, w, channels)."""
        convolved = self.conv(x).permute(0, 2, 3, 1).contiguous()
        return convolved, self.norm(convolved)


class AttentionPair(nn.Module):
    """Attention within windows, then across them over a grid."""

    def __init__(self, channels: int, head_dim: int) -> None:
        """The window block gets a normalised input, so it has no first norm of its own."""
        super().__init__()
        self.att_window = PartitionAttention(channels, head_dim, kind="window", first_norm=False)
        self.att_grid = PartitionAttention(channels, head_dim, kind="grid", first_norm=True)

    def forward(self, x: Tensor, partition: tuple[int, int]) -> tuple[Tensor, Tensor]:
        """Return what (B, h, w, C) is after the window block and after both."""
        window = self.att_window(x, partition)
        return window, self.att_grid(window, partition)


class Stage(nn.Module):
    """One scale: downsampling, one pair of attention blocks, recurrence."""

    def __init__(self, in_channels: int, channels: int, stride: int, head_dim: int) -> None:
        """Build a stage that divides height and width by `stride`."""
        super().__init__()
        self.downsample_cf2cl = Downsample(in_channels, channels, stride)
        self.att_blocks = nn.ModuleList([AttentionPair(channels, head_dim)])
        self.lstm = ConvLSTM(channels)

    def forward(self, x: Tensor, state: State | None, partition: tuple[int, int]) -> Trace:
        """Run (T, N, C, H, W); `state` is channels last, as everything in the trace.

        Only the recurrence needs time in order: the rest sees T*N frames as one batch.
        """
        parts = [self._feed_forward(part, partition) for part in self._portions(x.flatten(0, 1))]
        maps = parts[0] if len(parts) == 1 else map(torch.cat, zip(*parts, strict=True))
        convolved, normalised, window, attention = (
            each.view(*x.shape[:2], *each.shape[1:]) for each in maps
        )
        hidden, cell = self.lstm(attention, state)
        return Trace(convolved, normalised, window, attention, hidden, cell)

    def _feed_forward(
        self, x: Tensor, partition: tuple[int, int]
    ) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        convolved, normalised = self.downsample_cf2cl(x)
        return convolved, normalised, *self.att_blocks[0](normalised, partition)

    def _portions(self, x: Tensor) -> Sequence[Tensor]:
        """Frames (B, C, H, W) in portions whose maps a processor's cache holds between layers."""
        if x.device.type != "cpu":
            return (x,)
        conv = self.downsample_cf2cl.conv
        values = x.shape[0] * conv.out_channels * x.shape[2] * x.shape[3] // conv.stride[0] ** 2
        return x.chunk(max(1, -(-values // CACHED_VALUES)))

    def tap(self, name: str, trace: Trace, state: State | None) -> Tensor:
        """One named quantity of a run, (T, N, h, w, C)."""
        if name in Trace._fields:
            traced: Tensor = getattr(trace, name)
            return traced
        logits = self.lstm.gates(trace.attention, trace.hidden, None if state is None else state[0])
        if name == "gate_logits":
            return logits[2]
        if name == "candidate":
            return logits[3].tanh()
        return logits[("forget_gate", "input_gate", "gate").index(name)].sigmoid()


class RVTBackbone(nn.Module):
    """Four recurrent stages at strides 4, 8, 16 and 32, or the first of these.

    Convention: inputs of any size are padded with zeros at the right and at the bottom to the
    multiple of `32 * partition_split_32`; features and states have the padded size. The partition
    is (padded height, padded width) over that multiple, the same in every stage.
    """

    def __init__(
        self,
        in_channels: int,
        embed_dim: int,
        head_dim: int,
        partition_split_32: int = 2,
        stages: int = 4,
    ) -> None:
        """Build stages of 1, 2, 4 and 8 times `embed_dim` channels."""
        super().__init__()
        self.in_channels = in_channels
        self.partition_split_32 = partition_split_32
        self.multiple = STRIDES[-1] * partition_split_32
        self.widths = [embed_dim * factor for factor in (1, 2, 4, 8)][:stages]
        self.strides = STRIDES[:stages]
        self.stages = nn.ModuleList(
            Stage(before, after, stride, head_dim)
            for before, after, stride in zip(
                [in_channels, *self.widths], self.widths, (4, 2, 2, 2), strict=False
            )
        )

    def forward(self, x: Tensor, states: States | None = None) -> tuple[list[Tensor], States]:
        """Run one time step.

        Args:
            x: (N, 20, H, W), any real number type, any size.
            states: (h, c) of each stage from the step before, None at the start.

        Returns:
            Features (N, C, h, w) of the four stages, and the new states.
        """
        features, states = self.forward_sequence(x[None], states)
        return [feature[0] for feature in features], states

    def forward_sequence(
        self, x: Tensor, states: States | None = None
    ) -> tuple[list[Tensor], States]:
        """Run T steps of (T, N, 20, H, W), stage by stage; features are (T, N, C, h, w)."""
        features, after = [], []
        for trace in self._run(x, states, len(self.stages)):
            features.append(_channels_first(trace.hidden))
            after.append((features[-1][-1], _channels_first(trace.cell)[-1]))
        return features, after

    def taps(
        self,
        x: Tensor,
        states: States | None = None,
        stages: Sequence[int] = (1, 2, 3),
        names: Sequence[str] = ("gate", "hidden"),
    ) -> tuple[dict[str, list[Tensor]], States]:
        """Run T steps and return inner quantities; stops after the last stage asked for.

        Args:
            x: (T, N, 20, H, W).
            states: (h, c) of at least the stages run, None at the start.
            stages: numbers from 1 (stride 4) to 4 (stride 32).
            names: any of `TAPS`. `conv` and `downsample` are the strided convolution before and
                after its norm, `window` and `attention` the maps after either attention block,
                `gate` the output gate after and `gate_logits` before the sigmoid.

        Returns:
            For each name the maps (T, N, C, h, w) in the order of `stages`, and the states of
            the stages run.

        Raises:
            ValueError: an unknown name or stage.
        """
        unknown = [name for name in names if name not in TAPS]
        if unknown or not stages or not set(stages) <= {1, 2, 3, 4}:
            raise ValueError(
                f"Expected stages from 1 to 4 and taps among {', '.join(TAPS)}; "
                f"got stages {list(stages)} and taps {list(names)}"
            )
        found: dict[tuple[str, int], Tensor] = {}
        after = []
        for index, trace in enumerate(self._run(x, states, max(stages))):
            after.append((_channels_first(trace.hidden)[-1], _channels_first(trace.cell)[-1]))
            if index + 1 in stages:
                before = None if states is None else _channels_last(states[index])
                for name in names:
                    tap = cast(Stage, self.stages[index]).tap(name, trace, before)
                    found[name, index + 1] = _channels_first(tap)
        return {name: [found[name, stage] for stage in stages] for name in names}, after

    def _run(self, x: Tensor, states: States | None, last: int) -> Iterator[Trace]:
        x, partition = self._prepare(x)
        for index, stage in enumerate(self.stages[:last]):
            state = None
            if states is not None:
                expected = (x.shape[1], self.widths[index], *self._map_size(x, index))
                _check_state(states, index, expected)
                state = _channels_last(states[index])
            trace = stage(x, state, partition)
            x = _channels_first(trace.hidden)
            yield trace

    def _map_size(self, x: Tensor, index: int) -> tuple[int, int]:
        stride = 4 if index == 0 else 2
        return x.shape[-2] // stride, x.shape[-1] // stride

    def _prepare(self, x: Tensor) -> tuple[Tensor, tuple[int, int]]:
        if x.ndim != 5 or x.shape[2] != self.in_channels:
            raise ValueError(
                f"Expected event tensors of {self.in_channels} channels, shape (T, N, "
                f"{self.in_channels}, H, W), got {tuple(x.shape)}; set the model's in_channels to "
                "twice the representation's bins"
            )
        if not x.is_floating_point():
            x = x.to(compute_dtype(next(self.parameters())))
        if torch.is_grad_enabled():
            # Pays off in the gradient of the first convolution; for inference alone it does not.
            x = x.flatten(0, 1).contiguous(memory_format=torch.channels_last).view(x.shape)
        height, width = x.shape[-2:]
        rows, columns = -(-height // self.multiple), -(-width // self.multiple)
        pad = (0, columns * self.multiple - width, 0, rows * self.multiple - height)
        return functional.pad(x, pad) if any(pad) else x, (rows, columns)


def _channels_first(x: Tensor) -> Tensor:
    return x.movedim(-1, -3)


def _channels_last(state: State) -> State:
    return state[0].movedim(-3, -1), state[1].movedim(-3, -1)


def _check_state(states: States, index: int, expected: tuple[int, ...]) -> None:
    found = tuple(states[index][0].shape) if index < len(states) else None
    if found != expected:
        raise ValueError(
            f"Expected a state of shape {expected} for stage {index + 1}, got {found}; start with "
            "states=None when the batch or the image size changes"
        )
