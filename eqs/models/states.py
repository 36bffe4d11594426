"""Recurrent states between calls, and the frames kept for the detector."""

from __future__ import annotations

from collections.abc import Sequence

from torch import Tensor

from eqs.models.lstm import State

States = list[State]


def reset_states(states: States | None, first: Tensor) -> States | None:
    """Zero the states of the samples that start a new sequence.

    Args:
        states: (h, c) of every stage, each (N, C, h, w), or None.
        first: (N,) bool, True where the next frame has no past.
    """
    if states is None:
        return None
    again = first.view(-1, 1, 1, 1)
    return [(hidden.masked_fill(again, 0), cell.masked_fill(again, 0)) for hidden, cell in states]


def detach_states(states: States | None) -> States | None:
    """The same values without their history, for truncated backpropagation."""
    if states is None:
        return None
    return [(hidden.detach(), cell.detach()) for hidden, cell in states]


def gather_frames(features: Sequence[Tensor], keep: Tensor) -> list[Tensor]:
    """Pick frames (F, C, h, w), time-major, from maps (T, N, C, h, w) by a (T, N) bool mask.

    Convention: with `keep` true at (t0, n1), (t1, n0), frames come in that order, as rows of
    `labels[keep]` do.
    """
    if bool(keep.all()):
        return [feature.flatten(0, 1) for feature in features]
    index = keep.flatten().nonzero().squeeze(1)
    # Indexing the channels-last memory keeps it channels-last.
    picked = [x.flatten(0, 1).permute(0, 2, 3, 1).index_select(0, index) for x in features]
    return [x.permute(0, 3, 1, 2) for x in picked]
