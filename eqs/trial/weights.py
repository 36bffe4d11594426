"""Weights of channels, learned from streams whose order is known."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Final

import torch
from torch import Tensor
from torch.nn import functional

STEPS: Final = 300
SHARPNESS: Final = 30.0  # a difference of a thirtieth decides a pair
CHANGE: Final = 0.05  # of the logs of weights, a step


def weighted(channels: Sequence[Tensor], weights: Sequence[Tensor]) -> Tensor:
    """Agreement with weighted channels, by stream, mean over stages.

    Args:
        channels: by stage products and squares by stream and channel, (2, S, C).
        weights: by stage one per channel, positive.

    Example:
        >>> channels = [torch.tensor([[[2.0, 0.0]], [[2.0, 4.0]]])]
        >>> [weighted(channels, [torch.tensor(w)]).item() for w in ([1.0, 1.0], [1.0, 0.25])]
        [0.333..., 0.666...]
    """
    stages = [
        (both[0] @ each.to(both)) / (both[1] @ each.to(both)).clamp_min(1e-12)
        for both, each in zip(channels, weights, strict=True)
    ]
    return torch.stack(stages).mean(dim=0)


def learned(
    recordings: Sequence[tuple[Sequence[Tensor], Sequence[Sequence[int]]]],
) -> list[Tensor]:
    """Weights under which as many pairs as can be are in order.

    Args:
        recordings: of each the sums of its streams, and chains of their numbers, nearest first.

    Source: Zhang et al., "The unreasonable effectiveness of deep features as a perceptual metric",
    CVPR 2018, with a logistic loss of pairs in place of its judgements.
    """
    sizes = [both.shape[-1] for both in recordings[0][0]]
    logs = [torch.zeros(size, dtype=torch.float64, requires_grad=True) for size in sizes]
    optimizer = torch.optim.Adam(logs, lr=CHANGE)
    pairs = [
        torch.tensor([pair for chain in chains for pair in itertools.combinations(chain, 2)])
        for _, chains in recordings
    ]
    for _ in range(STEPS):
        optimizer.zero_grad()
        losses = []
        for (channels, _), each in zip(recordings, pairs, strict=True):
            scores = weighted(channels, [log.exp() for log in logs])
            losses.append(
                functional.softplus(SHARPNESS * (scores[each[:, 1]] - scores[each[:, 0]])).mean()
            )
        torch.stack(losses).mean().backward()
        optimizer.step()
    return [log.detach().exp() for log in logs]
