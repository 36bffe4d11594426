"""Recurrent states between calls, and the frames kept for the detector."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, distributed

from eqs.models.lstm import State
from eqs.models.synchronised import processes

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


def of_all_processes(states: States | None) -> States | None:
    """The states of the whole batch, on the CPU: those of the first process come first."""
    if processes() == 1 or states is None:
        return states
    parts: list[States] = [[]] * processes()
    distributed.all_gather_object(parts, move_states(states, torch.device("cpu")))
    return [
        (torch.cat([hidden for hidden, _ in stage]), torch.cat([cell for _, cell in stage]))
        for stage in zip(*parts, strict=True)
    ]


def of_this_process(states: States | None) -> States | None:
    """This process's part of the whole batch's states."""
    if states is None:
        return None
    rank = distributed.get_rank() if processes() > 1 else 0
    return [
        (hidden.chunk(processes())[rank], cell.chunk(processes())[rank]) for hidden, cell in states
    ]


def move_states(states: States, device: torch.device) -> States:
    """Recurrent states on another device."""
    return [(hidden.to(device), cell.to(device)) for hidden, cell in states]
