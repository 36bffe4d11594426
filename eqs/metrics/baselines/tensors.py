"""Baselines that compare the detector's input tensors, cell by cell or patch by patch."""

from __future__ import annotations

import math
from collections.abc import Iterable

import torch
from torch import Tensor
from torchmetrics.functional.image import structural_similarity_index_measure

from eqs.metrics.pooling import pool_patches
from eqs.metrics.similarity import mean_over_stages, patch_cosine

PATCH_PIXELS = 12  # a patch of EQS at its finest: 3 cells at stride 4


def tensor_baselines(chunks: Iterable[Tensor], count_cutoff: float) -> dict[str, float]:
    """Peak signal-to-noise ratio, structural similarity and patch cosine of histograms.

    `voxel_psnr` is in dB, of one mean square error over all windows, infinite for equal streams;
    `voxel_ssim` and `raw_cosine`, the formula of EQS on the input itself, are means over windows,
    1 for equal streams. `count_cosine` is one cosine of all cells of all windows, of the counts per
    pixel, polarity and bin.

    Args:
        chunks: histograms (windows, 2, 2 * bins, height, width), simulated first, then real.
        count_cutoff: the largest count.

    Source: Wang et al., "Image quality assessment", TIP 2004, with its Gaussian window.
    """
    errors, similarities, cosines = [], [], []
    product = torch.zeros(3, dtype=torch.float64)  # of both, of the first by itself, of the second
    for chunk in chunks:
        simulated, real = chunk[:, 0].float(), chunk[:, 1].float()
        errors.append((simulated - real).square().mean(dim=(1, 2, 3)))
        product += torch.stack(
            [(a * b).double().sum() for a, b in ((simulated, real), (simulated,) * 2, (real,) * 2)]
        )
        for pair in zip(simulated[:, None], real[:, None], strict=True):
            similarity = structural_similarity_index_measure(*pair, data_range=count_cutoff)
            similarities.append(torch.as_tensor(similarity))
        pooled, wanted = (pool_patches(each, PATCH_PIXELS) for each in (simulated, real))
        cosines.append(mean_over_stages([patch_cosine(pooled, wanted)]))
    error = float(torch.cat(errors).mean())
    return {
        "voxel_psnr": 10 * math.log10(count_cutoff**2 / error) if error else math.inf,
        "voxel_ssim": float(torch.stack(similarities).mean()),
        "raw_cosine": float(torch.cat(cosines).mean()),
        "count_cosine": float(product[0] / (product[1] * product[2]).sqrt().clamp(min=1e-12)),
    }
