"""Scores that could be the headline, from the same maps of a judge's hidden states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import torch
from torch import Tensor
from torch.nn import functional

from eqs.metrics.pooling import pool_patches
from eqs.metrics.similarity import patch_agreement, patch_cosine, whitening_matrix

HEADLINE: Final = "agreement, silence, cells"  # what `EventQualityScore` computes
RESET: Final = ", state reset"  # ends the name where every window starts anew
SMALL: Final = 1e-4  # in the ratios of local structure and texture


@dataclass(frozen=True, kw_only=True)
class Means:
    """What is subtracted beside silence: statistics of real features of a stage.

    Args:
        centre: mean feature, shape (channels,).
        covariance: of features from silence, shape (channels, channels).
    """

    centre: Tensor
    covariance: Tensor


@dataclass
class Challengers:
    """Every challenger's score of some streams against a reference, summed up window by window.

    Args:
        means: by stage.
        skip: windows at the start that do not count.
    """

    means: Sequence[Means]
    skip: int
    sums: dict[str, Tensor] = field(default_factory=dict)
    windows: int = 0
    channels: list[Tensor] = field(default_factory=list)
    """By stage, of every stream and channel, twice the products and the squares, (2, S, C)."""

    def add(self, stages: Sequence[Tensor], silence: Sequence[Tensor], first: int) -> None:
        """Add some windows.

        Args:
            stages: hidden states (windows, streams, channels, rows, columns), the reference first.
            silence: those of an empty stream in the same windows, (windows, 1, ...).
            first: number of the first of these windows.
        """
        kept = slice(max(0, self.skip - first), None)
        if not len(stages[0][kept]):
            return
        found: dict[str, list[Tensor]] = {}
        sums = []
        for stage, quiet, means in zip(stages, silence, self.means, strict=True):
            each, quiet = stage[kept], quiet[kept]
            for name, values in compared(each, quiet, means).items():
                found.setdefault(name, []).append(values)
            sums.append(channel_sums(each - quiet))
        for name, by_stage in found.items():
            total = torch.stack(by_stage).mean(dim=0).double().sum(dim=0)
            self.sums[name] = self.sums.get(name, torch.zeros_like(total)) + total
        self.channels = (
            [a + b for a, b in zip(self.channels, sums, strict=True)] if self.channels else sums
        )
        self.windows += len(stages[0][kept])

    def scores(self) -> dict[str, Tensor]:
        """By challenger the score of each stream but the reference."""
        return {name: total / self.windows for name, total in self.sums.items()}


def compared(stage: Tensor, silence: Tensor, means: Means) -> Mapping[str, Tensor]:
    """By challenger the similarity in each window, shape (windows, streams without the reference).

    Args:
        stage: hidden states (windows, streams, channels, rows, columns), the reference first.
        silence: those of an empty stream, (windows, 1, channels, rows, columns).
        means: statistics of the stage.
    """
    from_silence = stage - silence
    pooled, centred = pool_patches(from_silence, 3), pool_patches(stage, 3)
    whitening = whitening_matrix(means.covariance)
    white = torch.einsum("dc,...cij->...dij", whitening.to(stage), from_silence)
    agreed = agreement(from_silence)
    structure, texture = structure_and_texture(from_silence)
    active = (from_silence.square().sum(dim=2, keepdim=True) > 1e-3).double()
    return {
        "version 1: cosine, mean real, 3x3": cosine(centred, means.centre),
        "agreement, mean real, 3x3": agreement(centred - means.centre[:, None, None]),
        "cosine, silence, 3x3": cosine(pooled),
        "cosine, silence, cells": cosine(from_silence),
        "cosine, silence, active cells": masked(cosine_map(from_silence), active),
        "agreement, silence, 3x3": agreement(pooled),
        HEADLINE: agreed,
        "its distance form": 1 - (1 - agreed).clamp_min(0).sqrt(),
        "agreement, silence, whitened": agreement(white),
        "agreement, loud and quiet half": loud_and_quiet(from_silence),
        "structure and texture, silence": (structure + texture) / 2,
        "structure alone, silence": structure,
    }


def agreement(maps: Tensor) -> Tensor:
    """Of every stream's maps with the first's, each patch by what happens in it."""
    values, weights = patch_agreement(maps[:, 1:], maps[:, :1])
    total = weights.sum(dim=(-2, -1))
    nothing = total == 0
    summed = (values * weights).sum(dim=(-2, -1)) / torch.where(nothing, 1.0, total)
    found: Tensor = torch.where(nothing, 1.0, summed)
    return found


def cosine_map(maps: Tensor, centre: Tensor | None = None) -> Tensor:
    """Of every stream's patches with the first's."""
    return patch_cosine(maps[:, 1:], maps[:, :1], centre).double()


def cosine(maps: Tensor, centre: Tensor | None = None) -> Tensor:
    """Mean over patches of `cosine_map`."""
    return cosine_map(maps, centre).mean(dim=(-2, -1))


def masked(values: Tensor, active: Tensor) -> Tensor:
    """Mean of the patches that are active in either stream; 1 where none is."""
    counts = torch.maximum(active[:, 1:, 0], active[:, :1, 0])
    total = counts.sum(dim=(-2, -1))
    summed = (values * counts).sum(dim=(-2, -1)) / total.clamp_min(1)
    return torch.where(total == 0, 1.0, summed)


def loud_and_quiet(maps: Tensor) -> Tensor:
    """Mean of the agreements in the half of the cells where the reference responds more and less.

    So that what happens where nothing should is not lost beside what happens elsewhere.
    """
    values, weights = patch_agreement(maps[:, 1:], maps[:, :1])
    strength = maps[:, :1].square().sum(dim=2)
    middle = strength.flatten(-2).median(dim=-1).values[..., None, None]
    halves = []
    for chosen in (strength > middle, strength <= middle):
        total = (weights * chosen).sum(dim=(-2, -1))
        summed = (values * weights * chosen).sum(dim=(-2, -1)) / torch.where(total == 0, 1.0, total)
        halves.append(torch.where(total == 0, 1.0, summed))
    return (halves[0] + halves[1]) / 2


def structure_and_texture(maps: Tensor) -> tuple[Tensor, Tensor]:
    """Local covariance and local mean of every channel, as ratios, averaged.

    Source: Ding et al., "Image quality assessment: unifying structure and texture similarity",
    TPAMI 2022, on areas of 3x3 cells.
    """

    def local(x: Tensor) -> Tensor:
        flat = functional.avg_pool2d(x.flatten(0, 1), 3, stride=1)
        areas: Tensor = flat.unflatten(0, x.shape[:2])
        return areas

    a, b = maps[:, 1:], maps[:, :1]
    mean_a, mean_b = local(a), local(b)
    variance_a = local(a * a) - mean_a**2
    variance_b = local(b * b) - mean_b**2
    covariance = local(a * b) - mean_a * mean_b
    texture = (2 * mean_a * mean_b + SMALL) / (mean_a**2 + mean_b**2 + SMALL)
    structure = (2 * covariance + SMALL) / (variance_a + variance_b + SMALL)
    return structure.mean(dim=(-3, -2, -1)).double(), texture.mean(dim=(-3, -2, -1)).double()


def channel_sums(maps: Tensor) -> Tensor:
    """Twice the products with the reference, and the squares of both, by stream and channel."""
    a, b = maps[:, 1:].double(), maps[:, :1].double()
    products = 2 * (a * b).sum(dim=(0, 3, 4))
    squares = (a * a).sum(dim=(0, 3, 4)) + (b * b).sum(dim=(0, 3, 4))
    return torch.stack([products, squares])


def blurred_counts(histograms: Tensor, bins: int, sigma_px: float) -> Tensor:
    """Counts of events in so many bins at once, blurred in space.

    Args:
        histograms: shape (windows, streams, 20, height, width).
        bins: bins that are counted together, a whole part of 10.
        sigma_px: of the Gaussian, pixels.
    """
    counts = histograms.float().unflatten(2, (2, -1, bins)).sum(dim=4).flatten(2, 3)
    rows, columns = (_gaussian(pixels, sigma_px) for pixels in counts.shape[-2:])
    blurred: Tensor = rows @ counts @ columns
    return blurred


def _gaussian(pixels: int, sigma_px: float) -> Tensor:
    """The matrix that blurs so many pixels; what lies outside is dark."""
    at = torch.arange(pixels, dtype=torch.float32)
    weights = torch.exp(-0.5 * ((at[:, None] - at) / sigma_px) ** 2)
    matrix: Tensor = weights / (sigma_px * (2 * torch.pi) ** 0.5)
    return matrix


def of_counts(histograms: Tensor) -> dict[str, Tensor]:
    """By challenger without a network the similarity in each window, (windows, streams)."""
    fine, coarse = blurred_counts(histograms, 2, 1.0), blurred_counts(histograms, 5, 2.0)
    return {
        "counts, 10 ms, 1 px: agreement": agreement(fine),
        "counts, 25 ms, 2 px: agreement": agreement(coarse),
        "counts, 25 ms, 2 px: cosine": whole_cosine(coarse),
    }


def whole_cosine(maps: Tensor) -> Tensor:
    """One cosine of the whole map; 1 where both are nothing."""
    a, b = maps[:, 1:].flatten(2).double(), maps[:, :1].flatten(2).double()
    lengths = a.norm(dim=-1) * b.norm(dim=-1)
    both = (a.norm(dim=-1) == 0) & (b.norm(dim=-1) == 0)
    return torch.where(both, 1.0, (a * b).sum(dim=-1) / lengths.clamp_min(1e-12))
