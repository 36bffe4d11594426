"""Closed forms of the pools, and the smooth ones cell by cell."""

import math

import numpy as np
import pytest
import torch

from eqs.metrics import pool_grid, pool_patches, smooth_grid, smooth_patches


@pytest.mark.parametrize(
    ("cells", "patches"),
    [((120, 160), (40, 54)), ((60, 80), (20, 27)), ((30, 40), (10, 14)), ((1, 1), (1, 1))],
)
def test_patch_grid_rounds_up(cells, patches):
    assert pool_patches(torch.zeros(2, *cells)).shape == (2, *patches)


@pytest.mark.parametrize("pool", [pool_patches, smooth_patches])
def test_empty_patches_are_refused(pool):
    with pytest.raises(ValueError, match="at least one cell, got 0; set patch_size"):
        pool(torch.zeros(1, 2, 2), 0)


def test_a_grid_averages_equal_parts():
    maps = torch.arange(2 * 6 * 9.0).view(2, 6, 9)
    found = pool_grid(maps, 3)
    torch.testing.assert_close(found, maps.unflatten(2, (3, 3)).unflatten(1, (3, 2)).mean((2, 4)))


def smooth_by_loops(plane, middles, half_width):
    """The definition, cell by cell, for one channel."""
    rows, columns = (len(each) for each in middles)
    found = np.zeros((rows, columns))
    for index in np.ndindex(rows, columns):
        total = 0.0
        for cell in np.ndindex(plane.shape):
            weight = 1.0
            for axis in (0, 1):
                distance = abs(cell[axis] - middles[axis][index[axis]])
                weight *= max(0.0, 1 - distance / half_width[axis])
            found[index] += weight * plane[cell]
            total += weight
        found[index] /= total
    return found


@pytest.mark.parametrize("size", [1, 2, 3, 4])
@pytest.mark.parametrize("cells", [(1, 1), (7, 10), (3, 12)])
def test_smooth_patches_are_triangles_over_real_cells(size, cells):
    maps = torch.randn(2, *cells, dtype=torch.float64)
    found = smooth_patches(maps, size)
    assert found.shape == pool_patches(maps, size).shape
    middles = [np.arange(count) * size + (size - 1) / 2 for count in found.shape[-2:]]
    for plane, pooled in zip(maps.numpy(), found.numpy(), strict=True):
        np.testing.assert_allclose(smooth_by_loops(plane, middles, (size, size)), pooled)


@pytest.mark.parametrize("cells", [(1, 2), (6, 9), (7, 10)])
def test_a_smooth_grid_has_its_middles_in_the_parts(cells):
    maps = torch.randn(1, *cells, dtype=torch.float64)
    middles = [(np.arange(3) + 0.5) * count / 3 - 0.5 for count in cells]
    expected = smooth_by_loops(maps[0].numpy(), middles, [max(count / 3, 1) for count in cells])
    np.testing.assert_allclose(smooth_grid(maps, 3)[0], expected)


@pytest.mark.parametrize("pool", [smooth_patches, smooth_grid])
def test_a_smooth_pool_of_a_constant_map_is_constant(pool):
    found = pool(torch.full((2, 4, 7, 11), 0.3))
    torch.testing.assert_close(found, torch.full_like(found, 0.3))


def test_all_inner_cells_weigh_the_same_in_smooth_patches():
    maps = torch.zeros(9, 15, 15)
    for index in range(9):  # every place within the middle patch
        maps[index, 6 + index // 3, 6 + index % 3] = 1
    torch.testing.assert_close(smooth_patches(maps).sum(dim=(-2, -1)), torch.full((9,), 1 / 9))


def test_smooth_patches_do_not_alias():
    period_of_four_cells = torch.cos(torch.arange(60) * math.pi / 2).expand(1, 6, 60)
    box, smooth = (pool(period_of_four_cells) for pool in (pool_patches, smooth_patches))
    inner = slice(1, -1)
    assert smooth[..., inner].abs().max() < 0.4 * box[..., inner].abs().max()
