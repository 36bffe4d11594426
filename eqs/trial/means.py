"""Statistics of real features, for the challengers that subtract or whiten by them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from eqs.files import complete_file
from eqs.trial.challengers import Means


class Moments:
    """Sums over the cells of real recordings, by stage."""

    def __init__(self) -> None:
        """Start with nothing."""
        self.cells: list[int] = []
        self.totals: list[Tensor] = []
        self.products: list[Tensor] = []

    def add(self, stages: Sequence[Tensor], silence: Sequence[Tensor]) -> None:
        """Add some windows of a stream.

        Args:
            stages: hidden states by stage, (windows, 1, channels, rows, columns).
            silence: those of an empty stream in the same windows.
        """
        if not self.cells:
            channels = [stage.shape[2] for stage in stages]
            self.cells = [0] * len(stages)
            self.totals = [torch.zeros(each, dtype=torch.float64) for each in channels]
            self.products = [torch.zeros(each, each, dtype=torch.float64) for each in channels]
        for k, (stage, quiet) in enumerate(zip(stages, silence, strict=True)):
            features, away = (
                each.double().movedim(2, -1).flatten(0, -2) for each in (stage, stage - quiet)
            )
            self.cells[k] += len(features)
            self.totals[k] += features.sum(dim=0)
            self.products[k] += away.T @ away

    def means(self) -> list[Means]:
        """Mean feature, and mean product of features from silence, of every stage."""
        sums = zip(self.cells, self.totals, self.products, strict=True)
        return [
            Means(centre=(total / cells).float(), covariance=(products / cells).float())
            for cells, total, products in sums
        ]


def save_means(path: Path, means: Sequence[Means]) -> None:
    """Write what `load_means` reads; the file is there whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    arrays = [array.numpy() for each in means for array in (each.centre, each.covariance)]
    with complete_file(path) as partial, partial.open("wb") as file:
        np.savez(file, *arrays)


def load_means(path: Path) -> list[Means]:
    """Statistics by stage."""
    with np.load(path) as data:
        arrays = [torch.from_numpy(data[f"arr_{k}"]) for k in range(len(data))]
    pairs = zip(arrays[::2], arrays[1::2], strict=True)
    return [Means(centre=centre, covariance=covariance) for centre, covariance in pairs]
