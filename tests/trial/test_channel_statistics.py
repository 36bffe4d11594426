"""Statistics of features against numpy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from eqs.trial.means import Moments, load_means, save_means


def test_means_are_those_of_all_cells_of_all_windows(tmp_path: Path) -> None:
    torch.manual_seed(0)
    stages = [torch.randn(5, 1, 4, 3, 2), torch.randn(5, 1, 6, 2, 1)]
    silence = [torch.randn(5, 1, 4, 3, 2), torch.randn(5, 1, 6, 2, 1)]
    moments = Moments()
    for part in (slice(0, 2), slice(2, 5)):
        moments.add([each[part] for each in stages], [each[part] for each in silence])
    save_means(tmp_path / "means.npz", moments.means())
    found = zip(load_means(tmp_path / "means.npz"), stages, silence, strict=True)
    for means, stage, quiet in found:
        cells = stage.movedim(2, -1).flatten(0, -2).numpy()
        away = (stage - quiet).movedim(2, -1).flatten(0, -2).numpy()
        np.testing.assert_allclose(means.centre, cells.mean(axis=0), atol=1e-6)
        np.testing.assert_allclose(means.covariance, away.T @ away / len(away), atol=1e-5)
