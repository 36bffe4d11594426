"""Closed forms of the patch similarity."""

import math

import numpy as np
import pytest
import torch

from eqs.metrics import (
    combine_maps,
    mean_over_stages,
    patch_cosine,
    pool_patches,
    whitening_matrix,
)


def vectors(*columns):
    """Maps of one row whose cells are the given feature vectors."""
    return torch.tensor(columns, dtype=torch.float32).T[:, None, :]


def test_angle_of_sixty_degrees_scores_one_half():
    a, b = torch.zeros(2, 4, 5), torch.zeros(2, 4, 5)
    a[0] = 3.0
    b[0], b[1] = 0.5, math.sqrt(0.75)
    cosine = patch_cosine(pool_patches(a), pool_patches(b))
    assert cosine.shape == (2, 2)
    torch.testing.assert_close(cosine, torch.full((2, 2), 0.5))


def test_gain_does_not_matter():
    a = torch.randn(3, 8, 4, 4)
    torch.testing.assert_close(patch_cosine(a, 2 * a), torch.ones(3, 4, 4))
    torch.testing.assert_close(patch_cosine(a, -3 * a), -torch.ones(3, 4, 4))


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_identical_features_score_one_at_any_length(scale):
    a = torch.randn(16, 5, 5) * scale
    torch.testing.assert_close(patch_cosine(a, a), torch.ones(5, 5), atol=1e-6, rtol=0)


def test_zero_vectors():
    a, b = vectors((0, 0), (0, 0), (1, 0)), vectors((0, 0), (1, 2), (0, 0))
    assert patch_cosine(a, b).tolist() == [[1.0, 0.0, 0.0]]


def test_centre_moves_the_origin():
    centre = torch.tensor([1.0, 1.0])
    a, b = vectors((2, 1), (1, 1), (1, 1)), vectors((1, 2), (1, 1), (0, 1))
    assert patch_cosine(a, b, centre).tolist() == [[0.0, 1.0, 0.0]]
    assert patch_cosine(a, b)[0, 0] == pytest.approx(0.8)


def test_centre_of_another_width_is_refused():
    with pytest.raises(ValueError, match=r"centre of 2 channels, got shape \(3,\)"):
        patch_cosine(vectors((1, 0)), vectors((1, 0)), torch.zeros(3))


def test_two_channels_whitened_by_hand():
    whitening = whitening_matrix(torch.diag(torch.tensor([1.0, 4.0])))
    a, b = vectors((1, 1), (1, 0), (0, 0)), vectors((1, -1), (3, 0), (0, 0))
    # A tenth of the mean variance 2.5 takes the place of a tenth of each: 1.15 and 3.85.
    expected = (1 / 1.15 - 1 / 3.85) / (1 / 1.15 + 1 / 3.85)
    assert patch_cosine(a, b, None, whitening).tolist() == [pytest.approx([expected, 1, 1])]


def test_whitening_by_a_triangle_scores_as_the_symmetric_one_does():
    generator = np.random.default_rng(0)
    features = generator.normal(size=(500, 6)) @ generator.normal(size=(6, 6)) + 3
    mean, covariance = features.mean(0), np.cov(features.T)
    shrunk = 0.9 * covariance + 0.1 * np.trace(covariance) / 6 * np.eye(6)
    variances, axes = np.linalg.eigh(shrunk)
    symmetric = axes @ np.diag(variances**-0.5) @ axes.T
    a, b = (symmetric @ (x - mean) for x in features[:2])
    expected = a @ b / np.linalg.norm(a) / np.linalg.norm(b)
    x, y = (torch.from_numpy(each)[:, None, None] for each in features[:2])
    found = patch_cosine(x, y, torch.from_numpy(mean), whitening_matrix(torch.tensor(covariance)))
    assert found.item() == pytest.approx(expected, abs=1e-12)
    matrix = whitening_matrix(torch.tensor(covariance)).numpy()
    np.testing.assert_allclose(matrix @ shrunk @ matrix.T, np.eye(6), atol=1e-12)


def test_features_that_do_not_vary_cannot_be_whitened():
    with pytest.raises(ValueError, match="real features that vary, got the same everywhere"):
        whitening_matrix(torch.zeros(3, 3))


def test_silence_has_a_defined_gradient():
    a, b = torch.zeros(3, 2, 2, requires_grad=True), torch.randn(3, 2, 2)
    value = patch_cosine(a, b)
    value.sum().backward()
    assert value.abs().max() == 0
    assert torch.isfinite(a.grad).all()
    across = a.grad - (a.grad * b).sum(0) / b.square().sum(0) * b
    torch.testing.assert_close(across, torch.zeros_like(a))  # it points along b alone


def test_gradient_agrees_with_finite_differences():
    a = torch.randn(3, 4, 4, dtype=torch.float64, requires_grad=True)
    b = torch.randn(3, 4, 4, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(
        lambda u, v: patch_cosine(pool_patches(u), v[:, :2, :2]), (a, b)
    )


def test_padding_is_right_and_bottom_and_points_the_same_way_as_zeros():
    maps = torch.randn(2, 5, 4, 7)
    padded = torch.zeros(2, 5, 6, 9)
    padded[..., :4, :7] = maps
    with_zeros = padded.unflatten(3, (3, 3)).unflatten(2, (2, 3)).sum(dim=(3, 5))
    pooled = pool_patches(maps)
    torch.testing.assert_close(patch_cosine(pooled, with_zeros), torch.ones(2, 2, 3))
    torch.testing.assert_close(pooled[..., 1, 2], maps[..., 3, 6])


def test_half_the_unweighted_lpips_formula():
    a, b = torch.randn(4, 16, 3, 5).double(), torch.randn(4, 16, 3, 5).double()
    unit_a, unit_b = (
        torch.nn.functional.normalize(a, dim=1),
        torch.nn.functional.normalize(b, dim=1),
    )
    lpips = ((unit_a - unit_b) ** 2).sum(dim=1).mean(dim=(1, 2))
    torch.testing.assert_close(1 - patch_cosine(a, b).mean(dim=(1, 2)), lpips / 2)


def test_stages_weigh_the_same_whatever_their_size():
    stages = [torch.ones(2, 10, 10), torch.zeros(2, 1, 1)]
    assert mean_over_stages(stages).tolist() == [0.5, 0.5]


def test_maps_of_all_stages_land_on_the_pixels_they_cover():
    fine = torch.zeros(3, 5)
    coarse = torch.arange(6.0).view(2, 3)
    image = combine_maps([fine, coarse], [4, 8]) * 2
    assert image[0].tolist() == [0, 0, 1, 1, 2]
    assert image[2].tolist() == [3, 3, 4, 4, 5]
