"""Patch similarity of two feature maps: the arithmetic of the Event Quality Score."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor


def patch_cosine(
    a: Tensor,
    b: Tensor,
    centre: Tensor | None = None,
    whitening: Tensor | None = None,
    eps: float = 1e-8,
) -> Tensor:
    r"""Cosine between the feature vectors of two streams, patch by patch.

    .. math:: \cos(a, b) = \frac{W (a - m) \cdot W (b - m)}{\|W (a - m)\| \, \|W (b - m)\|}

    Convention: a vector no longer than `eps` counts as zero. Two zero vectors are equal and score
    1; a zero vector beside any other scores 0. `eps` is a threshold, never added to a norm, so
    that identical vectors score 1 however short they are.

    Args:
        a: pooled features of one stream, shape (..., channels, rows, columns).
        b: pooled features of the other stream, same shape or one that broadcasts to it.
        centre: mean feature vector `m`, shape (channels,), subtracted from both.
        whitening: matrix `W`, shape (channels, channels), applied to both; none leaves them.
        eps: length up to which a vector counts as zero.

    Returns:
        Values in [-1, 1], shape (..., rows, columns).

    Raises:
        ValueError: the centre has another number of channels.

    Example:
        >>> x = torch.tensor([1.0, 0.0]).view(2, 1, 1)
        >>> y = torch.tensor([0.5, 0.75**0.5]).view(2, 1, 1)
        >>> round(patch_cosine(x, y).item(), 6)
        0.5
    """
    a, b = (moved(each, centre, whitening) for each in (a, b))
    length_a = torch.linalg.vector_norm(a, dim=-3)
    length_b = torch.linalg.vector_norm(b, dim=-3)
    unit_a = a / length_a.clamp_min(eps).unsqueeze(-3)
    unit_b = b / length_b.clamp_min(eps).unsqueeze(-3)
    zero_a, zero_b = length_a <= eps, length_b <= eps
    cosine = (unit_a * unit_b).sum(dim=-3).clamp(-1.0, 1.0)
    return torch.where(zero_a | zero_b, (zero_a & zero_b).to(cosine.dtype), cosine)


def moved(x: Tensor, centre: Tensor | None = None, whitening: Tensor | None = None) -> Tensor:
    """Features from a centre on and whitened, if asked for.

    Args:
        x: shape (..., channels, rows, columns).
        centre: feature vector, shape (channels,), that is subtracted.
        whitening: matrix, shape (channels, channels), that is then applied.

    Raises:
        ValueError: the centre has another number of channels.
    """
    if centre is not None:
        if centre.shape != (x.shape[-3],):
            raise ValueError(
                f"Expected a centre of {x.shape[-3]} channels, got shape {tuple(centre.shape)}; "
                "set eqs.judge to one with a centre of this backbone and tap"
            )
        x = x - centre.to(x)[:, None, None]
    return x if whitening is None else torch.einsum("dc,...cij->...dij", whitening.to(x), x)


def patch_agreement(a: Tensor, b: Tensor, eps: float = 1e-4) -> tuple[Tensor, Tensor]:
    r"""Agreement of the feature vectors of two streams, patch by patch, and what it weighs.

    .. math:: s_p = \frac{2\, a_p \cdot b_p}{\|a_p\|^2 + \|b_p\|^2}, \qquad
        w_p = \|a_p\|^2 + \|b_p\|^2

    The weighted mean of a map is :math:`2 \sum a \cdot b / (\sum \|a\|^2 + \sum \|b\|^2)`, one
    minus the squared distance of the maps over their squared lengths.

    Convention: vectors whose entries are `eps` or less, root of the mean square of both streams
    together, are nothing and weigh nothing.

    Args:
        a: features of one stream, from where nothing happens, shape (..., channels, rows, columns).
        b: those of the other, same shape or one that broadcasts to it.
        eps: what rounding leaves of a response to nothing.

    Returns:
        Agreement in [-1, 1] and weight, both of shape (..., rows, columns), float64.

    Source: the coefficient is that of Lin, "A concordance correlation coefficient", Biometrics
    1989, with the response to silence in place of the means.

    Example:
        >>> a = torch.tensor([1.0, 0.0]).view(2, 1, 1)
        >>> agreement, weight = patch_agreement(a, 2 * a)
        >>> agreement.item(), weight.item()
        (0.8, 5.0)
    """
    a, b = a.double(), b.double()
    weight = (a * a).sum(dim=-3) + (b * b).sum(dim=-3)
    something = weight > 2 * a.shape[-3] * eps**2
    agreement = 2 * (a * b).sum(dim=-3) / torch.where(something, weight, 1.0)
    return agreement * something, weight * something


def whitening_matrix(covariance: Tensor, shrinkage: float = 0.1) -> Tensor:
    r"""Matrix after which features of this covariance vary about alike in every direction.

    .. math:: W = L^{-1}, \qquad
        L L^T = (1 - \lambda) \, \Sigma + \lambda \, \frac{\operatorname{tr} \Sigma}{C} \, I

    Convention: a cosine is blind to rotations, so the triangular `W` of a Cholesky factor, that of
    the principal axes and the symmetric one (ZCA) give one score; the triangle is the plainest.
    Without the shrinkage :math:`\lambda` a direction in which real features hardly vary, as a
    covariance of few of them has many, would count as much as any other; with it no direction is
    stretched more than :math:`\sqrt{1 / \lambda}` times a direction of mean variance.

    Source: Kessy, Lewin and Strimmer, "Optimal whitening and decorrelation", 2018; the shrinkage
    is that of Ledoit and Wolf, 2004, with a fixed intensity.

    Args:
        covariance: covariance of the features, shape (channels, channels).
        shrinkage: share of the mean variance, in (0, 1].

    Returns:
        Shape (channels, channels), float64.

    Raises:
        ValueError: the features do not vary.

    Example:
        >>> whitening_matrix(torch.tensor([[4.0]]))
        tensor([[0.5000]], dtype=torch.float64)
    """
    exact = covariance.double()
    variance = exact.diagonal().mean()
    if not variance > 0:
        raise ValueError(
            "Expected real features that vary, got the same everywhere; take the centre of more "
            "real recordings or set eqs.features=centred"
        )
    unit = torch.eye(len(exact), dtype=exact.dtype, device=exact.device)
    factor = torch.linalg.cholesky((1 - shrinkage) * exact + shrinkage * variance * unit)
    inverse: Tensor = torch.linalg.solve_triangular(factor, unit, upper=False)
    return inverse


def mean_over_stages(stages: Sequence[Tensor]) -> Tensor:
    """Mean over patches in each stage, then over stages with equal weights.

    Convention: equal weights, not patch counts, because those would give the first of three
    stages more than three quarters of the score.

    Args:
        stages: patch similarities by stage, shape (..., rows, columns) each.

    Returns:
        Shape (...), float64.
    """
    return torch.stack([stage.double().mean(dim=(-2, -1)) for stage in stages]).mean(dim=0)


def combine_maps(stages: Sequence[Tensor], strides: Sequence[int]) -> Tensor:
    """Mean of the stages' patch maps on the grid of the finest stage.

    Every coarse patch is repeated over the fine patches whose top left pixel it covers. Ragged
    patches weigh as much as full ones within a stage but not after the repetition, so the mean of
    this map may differ slightly from the score. A patch that does not count, NaN, is left to the
    other stages.

    Args:
        stages: patch similarities by stage, shape (..., rows, columns) each.
        strides: pixels per cell in each stage.

    Returns:
        Shape (..., rows of the finest stage, columns of the finest stage).

    Example:
        >>> combine_maps([torch.zeros(2, 2), torch.ones(1, 1)], [4, 8])
        tensor([[0.5000, 0.5000],
                [0.5000, 0.5000]])
    """
    finest = min(range(len(stages)), key=lambda index: strides[index])
    rows, columns = stages[finest].shape[-2:]
    repeated = []
    for stage, stride in zip(stages, strides, strict=True):
        at_row = torch.arange(rows, device=stage.device) * strides[finest] // stride
        at_column = torch.arange(columns, device=stage.device) * strides[finest] // stride
        at_row, at_column = (
            at_row.clamp_max(stage.shape[-2] - 1),
            at_column.clamp_max(stage.shape[-1] - 1),
        )
        repeated.append(stage[..., at_row[:, None], at_column[None, :]])
    return torch.stack(repeated).nanmean(dim=0)
