"""Recurrent states between calls, and the frames kept for the detector."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import torch
from torch import Tensor, distributed

from eqs.models.lstm import State
from eqs.models.synchronised import processes

States = list[State]
"""Those of RVT: (hidden, cell) of every stage."""

# Those of any detector: tensors with one entry per sample along the first axis, in lists, tuples
# and dicts; None for a detector without.
Carried = Any


def map_states(change: Callable[..., Tensor], states: Carried, *others: Carried) -> Carried:
    """States with every tensor changed; given several, tensors of one place are changed together.

    Raises:
        ValueError: there is something else than tensors in lists, tuples and dicts.

    Example:
        >>> map_states(lambda x: 2 * x, [torch.ones(1), None])
        [tensor([2.]), None]
    """
    if states is None:
        return None
    if isinstance(states, Tensor):
        return change(states, *others)
    if isinstance(states, dict):
        return {
            name: map_states(change, each, *(other[name] for other in others))
            for name, each in states.items()
        }
    if type(states) in (list, tuple):
        parts = zip(states, *others, strict=True)
        return type(states)(map_states(change, *each) for each in parts)
    raise ValueError(
        f"Expected states of tensors in lists, tuples and dicts, got a {type(states).__name__}; "
        "change the detector's forward_sequence"
    )


def reset_states(states: Carried, first: Tensor) -> Carried:
    """Zero the states of the samples that start a new sequence.

    Args:
        states: as a detector carries them, or None.
        first: (N,) bool, True where the next frame has no past.

    Raises:
        ValueError: a state has not one entry per sample along its first axis.
    """

    def reset(state: Tensor) -> Tensor:
        if state.ndim < 1 or len(state) != len(first):
            raise ValueError(
                f"Expected states with one entry for each of {len(first)} samples along the first "
                f"axis, got shape {tuple(state.shape)}; change the detector's forward_sequence"
            )
        return state.masked_fill(first.view(-1, *[1] * (state.ndim - 1)), 0)

    return map_states(reset, states)


def detach_states(states: Carried) -> Carried:
    """The same values without their history, for truncated backpropagation."""
    return map_states(Tensor.detach, states)


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


def of_all_processes(states: Carried) -> Carried:
    """The states of the whole batch, on the CPU: those of the first process come first."""
    if processes() == 1 or states is None:
        return states
    parts: list[Carried] = [None] * processes()
    distributed.all_gather_object(parts, move_states(states, torch.device("cpu")))
    return map_states(lambda *same: torch.cat(same), *parts)


def of_this_process(states: Carried) -> Carried:
    """This process's part of the whole batch's states."""
    rank = distributed.get_rank() if processes() > 1 else 0
    return map_states(lambda state: state.chunk(processes())[rank], states)


def move_states(states: Carried, device: torch.device) -> Carried:
    """Recurrent states on another device."""
    return map_states(lambda state: state.to(device), states)
