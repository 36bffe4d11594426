"""The baseline that compares how a network's features are distributed, not where they lie."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor, nn
from torchmetrics.image.fid import FrechetInceptionDistance

from eqs.metrics.definition import Maps


class FeatureFrechet:
    """Fréchet distance between the features of real and of simulated streams.

    The patch vectors of all windows count as one sample per stream and stage, regardless of place
    and time: a stream of another street may come close, one of another sensor may not. The
    distance of two Gaussians with the samples' means and covariances is averaged over stages.

    It is a watcher of `eqs.metrics.score_streams`, so it costs no further pass of the network.

    Args:
        maps: activation whose features are compared, and how they are pooled.

    Source: Heusel et al., "GANs trained by a two time-scale update rule", NeurIPS 2017, with the
    judge in place of Inception.
    """

    def __init__(self, maps: Maps) -> None:
        """Start without features."""
        self.maps = maps
        self._distances: list[list[FrechetInceptionDistance]] = []

    def __call__(self, pooled: Mapping[Maps, Sequence[Tensor]]) -> None:
        """Add the features of some windows, the real stream first."""
        samples = [
            [stream.movedim(1, -1).flatten(0, 2) for stream in stage.unbind(1)]
            for stage in pooled[self.maps]
        ]
        if not self._distances:
            self._distances = [
                [_distance(real.shape[1], real.device) for _ in simulated]
                for real, *simulated in samples
            ]
        for distances, (real, *simulated) in zip(self._distances, samples, strict=True):
            for distance, sample in zip(distances, simulated, strict=True):
                distance.update(real, real=True)
                distance.update(sample, real=False)

    def values(self) -> list[float]:
        """The distance of each simulated stream, at least 0, lower is better."""
        by_stage = [[each.compute() for each in distances] for distances in self._distances]
        # Equal samples may come out a rounding below zero.
        return torch.tensor(by_stage).mean(dim=0).clamp(min=0.0).tolist()


class _Unchanged(nn.Identity):
    """What the metric takes for a network: the features are there already."""

    def __init__(self, num_features: int) -> None:
        super().__init__()
        self.num_features = num_features


def _distance(channels: int, device: torch.device) -> FrechetInceptionDistance:
    return FrechetInceptionDistance(feature=_Unchanged(channels)).to(device)
