"""Feature maps pooled over patches: one vector per patch."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor


def pool_patches(maps: Tensor, size: int = 3) -> Tensor:
    """Mean feature vector of every patch of `size` by `size` neighbouring cells.

    Convention: patches do not overlap. Where the map is no multiple of `size`, it is padded with
    zeros on the right and at the bottom, and a ragged patch is divided by its real cells. The
    divisor leaves a raw cosine as it is; a centred cosine needs the true mean.

    Args:
        maps: feature maps, shape (..., channels, rows, columns).
        size: side of a patch in cells.

    Returns:
        Shape (..., channels, patch rows, patch columns), both counts rounded up.

    Example:
        >>> pool_patches(torch.ones(2, 4, 3)).shape
        torch.Size([2, 2, 1])
    """
    if size < 1:
        raise ValueError(f"Expected patches of at least one cell, got {size}; set patch_size")
    flat = maps.reshape(-1, *maps.shape[-3:])
    pooled = F.avg_pool2d(flat, size, ceil_mode=True)
    return pooled.reshape(*maps.shape[:-2], *pooled.shape[-2:])


def pool_grid(maps: Tensor, side: int = 3) -> Tensor:
    """Mean feature vector of every part of a map cut into `side` by `side` parts.

    Convention: parts that do not come out even share their border cells.

    Args:
        maps: feature maps, shape (..., channels, rows, columns).
        side: parts per side.

    Returns:
        Shape (..., channels, side, side).

    Example:
        >>> pool_grid(torch.arange(4.0).view(1, 1, 4), side=1)
        tensor([[[1.5000]]])
    """
    flat = maps.reshape(-1, *maps.shape[-3:])
    return F.adaptive_avg_pool2d(flat, side).reshape(*maps.shape[:-2], side, side)


def smooth_patches(maps: Tensor, size: int = 3) -> Tensor:
    r"""Smoothly weighted mean feature vector around every patch of `pool_patches`.

    .. math:: w(d) = \max(0, 1 - |d| / n)

    for a cell at distance :math:`d` cells from the middle of a patch of side :math:`n`, in rows
    and in columns: for 3 cells the weights 1, 2, 3, 2, 1.

    Convention: one vector per patch, as `pool_patches` gives, but from `2 * size - 1` cells. An
    edge that moves across a border between patches passes gradually from one vector to the next
    and not at once. Away from the map's border every cell weighs the same in all patches together;
    there the weights of the real cells are divided by their sum.

    Args:
        maps: feature maps, shape (..., channels, rows, columns).
        size: side of a patch in cells.

    Returns:
        Shape (..., channels, patch rows, patch columns), both counts rounded up.

    Raises:
        ValueError: the size is no whole cell.

    Example:
        >>> smooth_patches(torch.tensor([[[0.0, 0.0, 0.0, 9.0, 0.0, 0.0]]]))
        tensor([[[1.1250, 2.2500]]])
    """
    if size < 1:
        raise ValueError(f"Expected patches of at least one cell, got {size}; set patch_size")
    rows, columns = (_triangles(cells, -(-cells // size), size, maps) for cells in maps.shape[-2:])
    return rows @ maps @ columns.T


def smooth_grid(maps: Tensor, side: int = 3) -> Tensor:
    """Smoothly weighted mean feature vector around every part of `pool_grid`.

    Convention: the weights are those of `smooth_patches` for the parts' side, and where parts are
    smaller than a cell those of linear interpolation.

    Args:
        maps: feature maps, shape (..., channels, rows, columns).
        side: parts per side.

    Returns:
        Shape (..., channels, side, side).

    Example:
        >>> smooth_grid(torch.arange(4.0).view(1, 1, 4), side=1)
        tensor([[[1.5000]]])
    """
    rows, columns = (_triangles(cells, side, cells / side, maps) for cells in maps.shape[-2:])
    return rows @ maps @ columns.T


def _triangles(cells: int, patches: int, step: float, like: Tensor) -> Tensor:
    """Weights of the cells for each patch of `step` cells, (patches, cells); a row sums to 1."""
    middle = (torch.arange(patches, dtype=torch.float64) + 0.5) * step - 0.5
    distance = (middle[:, None] - torch.arange(cells)).abs()
    weights = (1 - distance / max(step, 1)).clamp_min(0)
    return (weights / weights.sum(dim=1, keepdim=True)).to(like)
