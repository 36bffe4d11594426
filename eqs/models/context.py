"""The type of what hand-written gradients keep."""

from __future__ import annotations

from typing import Any, Protocol

from torch import Tensor


class Context(Protocol):
    """What autograd keeps between forward and backward; PyTorch's own type omits None."""

    saved_tensors: tuple[Any, ...]

    def save_for_backward(self, *tensors: Tensor | None) -> None:
        """Keep tensors for the backward pass."""

    def set_materialize_grads(self, value: bool) -> None:
        """Choose whether missing gradients come as zeros or as None."""
