"""Pooled features of event streams that run side by side through one backbone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Protocol

import torch
from torch import Tensor, nn

from eqs.metrics.definition import Definition
from eqs.metrics.pooling import pool_grid, pool_patches, smooth_grid, smooth_patches
from eqs.metrics.windows import normalised_counts

RVT_STRIDES = (4, 8, 16, 32)
ACTIVE = "active"
"""Name, beside those of the taps, of whether a patch has events."""

POOLS = {
    ("cells", "box"): pool_patches,
    ("cells", "smooth"): smooth_patches,
    ("grid", "box"): pool_grid,
    ("grid", "smooth"): smooth_grid,
}

# Whatever a backbone carries from one window to the next; only the backbone looks inside.
BackboneState = Any


class TappedBackbone(Protocol):
    """A network that shows its inner maps.

    Args:
        x: histograms, float, shape (windows, streams, channels, height, width).
        states: recurrent state after the previous window, None at the start.
        stages: stages to show, counted from 1.
        names: activations to show.

    Returns:
        By name a list by stage of maps (windows, streams, channels, rows, columns), whose rows and
        columns beyond the image are padding, and the state after the last window.
    """

    def taps(
        self, x: Tensor, states: BackboneState, *, stages: Sequence[int], names: Sequence[str]
    ) -> tuple[dict[str, list[Tensor]], BackboneState]:
        """Maps by name and stage, and the state after the last window."""


def strides_of(backbone: object, stages: Sequence[int]) -> tuple[int, ...]:
    """Pixels per cell of each stage: the backbone's own `strides`, else those of RVT."""
    strides = getattr(backbone, "strides", RVT_STRIDES)
    if max(stages) > len(strides):
        raise ValueError(
            f"Expected stages up to {len(strides)}, got {tuple(stages)}; set eqs.stages"
        )
    return tuple(int(strides[stage - 1]) for stage in stages)


def pooled_features(
    backbone: TappedBackbone,
    chunks: Iterable[Tensor],
    *,
    taps: Sequence[str],
    definition: Definition,
    device: torch.device | str = "cpu",
    gradients: bool = False,
) -> Iterator[dict[str, list[Tensor]]]:
    """Run streams side by side through the backbone and pool its maps.

    The state is carried from chunk to chunk, one per stream, from zero, or reset for every window.
    Cells that lie wholly in the padding below and right of the image are cut off before pooling.

    Args:
        backbone: network with `taps`; it runs in evaluation mode and in float32.
        chunks: histograms, shape (windows, streams, channels, height, width) each.
        taps: activations to pool.
        definition: stages, patches, counts and state.
        device: where the backbone lives.
        gradients: keep what the gradients of the features with respect to the chunks need.

    Yields:
        For each chunk, by tap a list by stage of shape (windows, streams, channels, patch rows,
        patch columns), float32. Under a mask also, as `ACTIVE`, whether a patch has events, bool,
        with one channel.

    Raises:
        ValueError: the backbone has fewer stages.
    """
    stages, side = definition.stages, definition.patch_size
    pool = POOLS[definition.patch, definition.pooling]
    strides = strides_of(backbone, stages)
    states: BackboneState = None
    for chunk in chunks:
        (windows, streams), (height, width) = chunk.shape[:2], chunk.shape[-2:]
        with _evaluation(backbone), torch.set_grad_enabled(gradients), _full_precision(device):
            counts = x = chunk.to(device=device, dtype=torch.float32)
            if definition.counts == "normalised":
                x = normalised_counts(counts, definition)
            if definition.state == "reset":  # as many streams of one window each
                x, states = x.flatten(0, 1)[None], None
            maps, states = backbone.taps(x, states, stages=stages, names=tuple(taps))
            pooled = {
                name: [
                    pool(full[..., : -(-height // stride), : -(-width // stride)].float(), side)
                    .flatten(0, 1)
                    .unflatten(0, (windows, streams))
                    for full, stride in zip(maps[name], strides, strict=True)
                ]
                for name in taps
            }
            if definition.mask == "active":
                total = counts.sum(dim=2, keepdim=True)
                pooled[ACTIVE] = [pool(pool_patches(total, px), side) > 0 for px in strides]
        yield pooled


@contextmanager
def _evaluation(backbone: object) -> Iterator[None]:
    """Put a module into evaluation mode and back, so that scoring leaves no trace on it."""
    was_training = isinstance(backbone, nn.Module) and backbone.training
    if was_training:
        backbone.eval()  # type: ignore[attr-defined]
    try:
        yield
    finally:
        if was_training:
            backbone.train()  # type: ignore[attr-defined]


def _full_precision(device: torch.device | str) -> torch.autocast:
    return torch.autocast(torch.device(device).type, enabled=False)
