"""Checkpoints that are whole or not there, finite, and say which training they belong to."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import lightning
import torch
from lightning.fabric.plugins import TorchCheckpointIO
from lightning.pytorch.callbacks import Callback
from torch import Tensor

from eqs.files import complete_file

IDENTITY = "identity"


class CompleteCheckpoints(TorchCheckpointIO):
    """Lets the trainer write checkpoints that get their names when they are complete."""

    def save_checkpoint(
        self,
        checkpoint: dict[str, Any],
        path: Path | str,
        storage_options: Any | None = None,  # noqa: ANN401 - the trainer's
    ) -> None:
        """Write one checkpoint; the one before stays until the new one reads back.

        Raises:
            OSError: the disk is full, or does not give back what was written.
        """
        with complete_file(path) as partial:
            torch.save(checkpoint, partial)
            require_readable(partial, Path(path))


class Identity(Callback):
    """Says in every checkpoint which training it belongs to.

    Args:
        identity: plain values by name, which a training that is to go on compares.
    """

    def __init__(self, identity: Mapping[str, Any]) -> None:
        """Keep the identity."""
        self.identity = dict(identity)

    def on_save_checkpoint(
        self, trainer: lightning.Trainer, _: lightning.LightningModule, checkpoint: dict[str, Any]
    ) -> None:
        """Add the identity before the checkpoint is written."""
        checkpoint[IDENTITY] = self.identity


def require_readable(written: Path, path: Path) -> None:
    """Refuse a checkpoint whose bytes are not those that were written, by their check sums.

    Args:
        written: the file, still under its temporary name.
        path: the name that it is to have.

    Raises:
        OSError: it does not read back.
    """
    try:
        with zipfile.ZipFile(written) as archive:
            damaged = archive.testzip()
    except zipfile.BadZipFile as error:
        damaged = str(error)
    if damaged is not None:
        raise OSError(
            f"Expected the checkpoint for {path} to read back as written, got damage in {damaged}; "
            "check the disk, or set paths.runs to another"
        )


def require_finite(weights: Mapping[str, Tensor], step: int) -> None:
    """Refuse weights that are NaN or infinite.

    Raises:
        ValueError: one of them is.
    """
    for name, values in weights.items():
        if values.is_floating_point() and not torch.isfinite(values).all():
            raise ValueError(
                f"Expected finite weights after step {step}, got NaN or infinity in {name}, so "
                "they are not kept; set recipe.learning_rate lower or trainer.precision=32-true"
            )
