"""Pooled features of event streams that run side by side through one backbone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Protocol

import torch
from torch import Tensor, nn

from eqs.metrics.definition import ACTIVATIONS, Definition, Maps
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

Pooled = dict[Maps, list[Tensor]]
"""Pooled maps by stage."""

# Whatever a backbone carries from one window to the next; only the backbone looks inside.
BackboneState = Any


class TappedBackbone(Protocol):
    """A network that shows its inner maps.

    Beside `taps` a network of your own has three attributes: `in_channels`, twice its time bins;
    `strides`, the pixels per cell of each stage; and `tap_names`, its activations, the one to
    compare first. Without them it is taken to be an RVT in this respect.

    Convention: inputs have the size of the sensor, and a network pads as it needs, right and below.

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


NAMED = ("taps", "tap_names", "strides", "in_channels")


def require_network(network: object) -> None:
    """See that a network of somebody's own can judge.

    Raises:
        ValueError: it lacks something.
    """
    missing = [name for name in NAMED if not hasattr(network, name)]
    if missing:
        raise ValueError(
            f"Expected a network with {', '.join(NAMED)}, got a {type(network).__name__} without "
            f"{', '.join(missing)}; set eqs.judge"
        )


def tap_names(backbone: object) -> tuple[str, ...]:
    """The activations that a network shows: its own `tap_names`, else those of RVT."""
    return tuple(getattr(backbone, "tap_names", ACTIVATIONS))


def require_taps(backbone: object, taps: Sequence[str]) -> None:
    """Refuse activations that a network does not show.

    Raises:
        ValueError: one of them is unknown.
    """
    known = tap_names(backbone)
    unknown = [tap for tap in taps if tap not in known]
    if unknown:
        raise ValueError(
            f"Expected a tap among {', '.join(known)}, got {', '.join(unknown)}; set eqs.tap"
        )


def choices_for(backbone: object) -> dict[str, Any]:
    """What a definition says of a network where nobody chooses: a tap, stages and bins it has."""
    names, strides = tap_names(backbone), getattr(backbone, "strides", RVT_STRIDES)
    chosen: dict[str, Any] = {}
    if Definition.tap not in names:
        chosen["tap"] = names[0]
    if len(strides) < len(Definition.stages):
        chosen["stages"] = tuple(range(1, len(strides) + 1))
    if hasattr(backbone, "in_channels"):
        chosen["bins"] = backbone.in_channels // 2
    return chosen


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
    definitions: Sequence[Definition],
    device: torch.device | str = "cpu",
    gradients: bool = False,
) -> Iterator[Pooled]:
    """Run streams side by side through the backbone and pool its maps.

    The state is carried from chunk to chunk, one per stream, from zero, or reset for every window.
    Cells that lie wholly in the padding below and right of the image are cut off before pooling.

    Args:
        backbone: network with `taps`; it runs in evaluation mode and in float32.
        chunks: histograms, shape (windows, streams, channels, height, width) each.
        definitions: what is read; they share one pass, see `Definition.one_pass`.
        device: where the backbone lives.
        gradients: keep what the gradients of the features with respect to the chunks need.

    Yields:
        For each chunk, by `Definition.maps` a list by stage of shape (windows, streams, channels,
        patch rows, patch columns), float32. Under a mask also, as the tap `ACTIVE`, whether a patch
        has events, bool, with one channel.

    Raises:
        ValueError: the backbone has fewer stages or no such tap, or its maps have other shapes.
    """
    taps = sorted({each.tap for each in definitions})
    require_taps(backbone, taps)
    definition, stages = definitions[0], definitions[0].stages
    wanted = {each.maps for each in definitions}
    masked = {each.maps._replace(tap=ACTIVE) for each in definitions if each.mask == "active"}
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
            check_maps(maps, taps, strides, tuple(x.shape))
            whole = {
                name: [
                    full[..., : -(-height // stride), : -(-width // stride)]
                    .float()
                    .flatten(0, 1)
                    .unflatten(0, (windows, streams))
                    for full, stride in zip(maps[name], strides, strict=True)
                ]
                for name in taps
            }
            pooled = {each: [pool_of(each, stage) for stage in whole[each.tap]] for each in wanted}
            if masked:
                total = counts.sum(dim=2, keepdim=True)
                events = [pool_patches(total, px) for px in strides]
                pooled |= {each: [pool_of(each, stage) > 0 for stage in events] for each in masked}
        yield pooled


def pool_of(maps: Maps, stage: Tensor) -> Tensor:
    """The maps (..., channels, rows, columns) of a stage pooled as asked for."""
    if maps.patch == "cells" and maps.patch_size == 1 and maps.pooling == "box":
        return stage
    return POOLS[maps.patch, maps.pooling](stage, maps.patch_size)


def check_maps(
    maps: Mapping[str, Sequence[Tensor]],
    taps: Sequence[str],
    strides: Sequence[int],
    shape: tuple[int, ...],
) -> None:
    """Refuse maps that are not those of histograms of this shape.

    Raises:
        ValueError: one is missing, or of other windows or streams, or does not cover the image.
    """
    windows, streams, _, height, width = shape
    wanted = [(windows, streams, "C", -(-height // px), -(-width // px)) for px in strides]
    for tap in taps:
        shapes = [tuple(each.shape) for each in maps.get(tap, ())]
        if len(shapes) != len(wanted) or not all(map(_covers, shapes, wanted)):
            raise ValueError(
                f"Expected maps of the tap {tap} by stage of shapes {wanted} or, padded, with more "
                f"rows and columns, got {shapes}; change the strides or the taps of the network"
            )


def _covers(shape: tuple[int, ...], wanted: tuple[Any, ...]) -> bool:
    return (
        len(shape) == len(wanted)
        and shape[:2] == wanted[:2]
        and all(there >= least for there, least in zip(shape[3:], wanted[3:], strict=True))
    )


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
