"""Weights from files, and into networks: exactly those wanted, or a sentence."""

from __future__ import annotations

import datetime
import pickle
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch
from torch import Tensor, nn

Module = TypeVar("Module", bound=nn.Module)
# What Super SloMo's checkpoints note beside their weights: a time and losses. None of it can do
# anything when it is read.
_SCALAR = np._core.multiarray.scalar  # type: ignore[attr-defined]
HARMLESS: list[Any] = [
    datetime.datetime,
    np.dtype,
    np.dtypes.Float32DType,
    np.dtypes.Float64DType,
    (_SCALAR, "numpy.core.multiarray.scalar"),
    (_SCALAR, "numpy._core.multiarray.scalar"),
]


def contents(path: Path) -> object:
    """What a file that PyTorch saved holds, on the processor; no program in it is run.

    Raises:
        ValueError: the file holds more than tensors, numbers and text, or cannot be read.
    """
    try:
        with torch.serialization.safe_globals(HARMLESS):
            return torch.load(path, map_location="cpu", weights_only=True)
    except (pickle.UnpicklingError, RuntimeError, EOFError, ValueError, KeyError) as error:
        if "GLOBAL" in str(error):
            raise ValueError(
                f"Expected nothing but tensors, numbers and text in {path}, got Python objects, "
                "which may run a program when they are read; where you trust the file, save its "
                "weights alone: torch.save({k: v for k, v in torch.load(FILE, weights_only=False)"
                ".items() if k.startswith('state_dict')}, OTHER)"
            ) from error
        raise ValueError(wanted(path, "a file that PyTorch cannot read")) from error


def wanted(path: Path, got: str) -> str:
    """The sentence about a file that is none of those that are understood."""
    return (
        "Expected a TorchScript file, a Super SloMo checkpoint or RIFE 4.25 weights, "
        f"got {got} at {path}; set interpolation.inner.network"
    )


def plain(content: object) -> dict[str, Tensor]:
    """The weights in a file's content by their names, of training on several GPUs or on one.

    Example:
        >>> list(plain({"module.conv.bias": torch.zeros(1), "epoch": 3}))
        ['conv.bias']
    """
    found = content.items() if isinstance(content, Mapping) else ()
    return {
        name.removeprefix("module."): tensor
        for name, tensor in found
        if isinstance(name, str) and isinstance(tensor, Tensor)
    }


def filled(make: Callable[[], Module], weights: Mapping[str, Tensor]) -> Module:
    """A network with these weights, all of them and no others, as float32 and for use alone.

    It is made without memory and without drawing first weights, so that nobody else's random
    numbers change.

    Raises:
        ValueError: names or shapes are not those of the network; says the first that differs.
    """
    with torch.device("meta"):
        network = make()
    own = {name: tuple(tensor.shape) for name, tensor in network.state_dict().items()}
    given = {name: tuple(tensor.shape) for name, tensor in weights.items()}
    for name in [*own, *given]:
        if own.get(name) != given.get(name):
            raise ValueError(
                f"Expected {own.get(name, 'no weights')} as {name}, "
                f"got {given.get(name, 'none')}; the network is another"
            )
    network.load_state_dict(weights, assign=True)
    return network.float().eval().requires_grad_(False)
