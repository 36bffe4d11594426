"""TorchScript files, such as FILM's: networks that bring their own program."""

from __future__ import annotations

import warnings
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from eqs.frames.networks.planes import Between, on_frames


def is_script(path: Path) -> bool:
    """Whether a file is TorchScript: an archive with constants, which plain weights lack."""
    if not zipfile.is_zipfile(path):
        return False
    with zipfile.ZipFile(path) as archive:
        return any(name.endswith("/constants.pkl") for name in archive.namelist())


def script_of(path: Path) -> Between:
    """The network of a TorchScript file, in float32 on the processor.

    Its `forward` takes two frames (N, C, H, W), levels 0 to 1, and the share of the way from the
    first to the second: a float, or a tensor (N, 1) where its signature says so. Whether it sees
    grey or colour is told by the first of its weights with four dimensions.

    Raises:
        ValueError: the file is broken, or its `forward` takes something else.
    """
    with deprecation_unsaid():
        try:
            network = torch.jit.load(str(path), map_location="cpu").eval().float()
        except RuntimeError as error:
            said = str(error).strip().partition("\n")[0]
            raise ValueError(
                f"Expected a TorchScript file that PyTorch can read at {path}, got: {said}"
            ) from error
    as_tensor = share_is_tensor(network.forward.schema, path)

    def between(first: Tensor, second: Tensor, shares: Sequence[float]) -> Iterator[Tensor]:
        for share in shares:
            at = first.new_full((len(first), 1), share) if as_tensor else share
            with deprecation_unsaid(), as_written():
                made = network(first, second, at)
            yield made

    channels = [p.shape[1] for p in network.parameters() if p.ndim == 4]
    return on_frames(between, channels[0] if channels else None)


def share_is_tensor(schema: Any, path: Path) -> bool:  # noqa: ANN401 - PyTorch gives it no type
    """Whether the share is given as a tensor, from the signature of `forward`.

    Raises:
        ValueError: it takes something else than two tensors and a share.
    """
    arguments = schema.arguments[1:]  # the first is the network itself
    kinds = [str(argument.type) for argument in arguments[:3]]
    spare = all(argument.has_default_value() for argument in arguments[3:])
    if kinds[:2] != ["Tensor", "Tensor"] or kinds[2:] not in (["Tensor"], ["float"]) or not spare:
        shown = ", ".join(f"{argument.name}: {argument.type}" for argument in arguments)
        raise ValueError(
            "Expected a network whose forward takes two tensors and a share, a float or a tensor, "
            f"got forward({shown}) in {path}; wrap it in one that does"
        )
    return kinds[2] == "Tensor"


def as_written() -> AbstractContextManager[None]:
    """Run a script without rewriting it by what earlier calls looked like.

    The first calls and the later ones would else be different programs, and equal frames could
    come out unequal.
    """
    context: AbstractContextManager[None] = torch.jit.optimized_execution(False)  # type: ignore[attr-defined]
    return context


@contextmanager
def deprecation_unsaid() -> Iterator[None]:
    """Keep from users that TorchScript is deprecated: authors of networks still publish in it."""
    with warnings.catch_warnings():
        for category in (DeprecationWarning, FutureWarning):
            warnings.filterwarnings("ignore", message=r".*torch\.jit", category=category)
        yield
