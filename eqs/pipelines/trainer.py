"""The configured trainer, and what is kept when it is interrupted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import lightning
from hydra.errors import InstantiationException
from hydra.utils import instantiate
from lightning.fabric.utilities.exceptions import MisconfigurationException
from lightning.pytorch.callbacks import Callback, ModelCheckpoint
from omegaconf import DictConfig

from eqs.extras import needed
from eqs.pipelines.command import Interrupted
from eqs.pipelines.runs import Run
from eqs.training import CompleteCheckpoints, Identity, SynchronisedNorms


def check_trainer(cfg: DictConfig) -> bool:
    """Build a trainer that trains nothing, so that what it lacks is missed before the work.

    Returns:
        Whether this is the first of the processes that train together.

    Raises:
        ValueError: an accelerator or an optional package is not there.
    """
    with TemporaryDirectory() as nowhere:
        return bool(build_trainer(cfg, Run(Path(nowhere)), {}).is_global_zero)


def build_trainer(cfg: DictConfig, run: Run, identity: Mapping[str, Any]) -> lightning.Trainer:
    """The configured trainer, writing into the run's folder.

    Args:
        cfg: the configuration of a training.
        run: where checkpoints and curves are kept.
        identity: what every checkpoint says of its training.
    """
    last = ModelCheckpoint(
        run.checkpoints,
        filename="last",
        save_on_train_epoch_end=True,  # every epoch's, not only those that end in a validation
        enable_version_counter=False,
    )
    best = ModelCheckpoint(
        run.checkpoints,
        filename="best",
        monitor="val/map",
        mode="max",
        save_weights_only=True,
        enable_version_counter=False,
    )
    shown = instantiate(cfg.callbacks).values()
    callbacks: list[Callback] = [Identity(identity), last, best, *shown]
    with needed("all", "to log"):
        loggers = [logger(save_dir=run.folder) for logger in instantiate(cfg.logger).values()]
    # Norms over all processes, so that their number changes nothing.
    plugins = [CompleteCheckpoints(), SynchronisedNorms()]
    try:
        trainer: lightning.Trainer = instantiate(
            cfg.trainer, callbacks=callbacks, logger=loggers, plugins=plugins
        )
    except InstantiationException as error:
        if isinstance(error.__cause__, MisconfigurationException):
            raise ValueError(
                f"Expected a trainer that can run here, got: {error.__cause__}; set trainer=auto "
                "or trainer=cpu, or what is wrong below trainer"
            ) from error
        raise
    return trainer


@contextmanager
def resumable(run: Run) -> Iterator[None]:
    """Say what is kept when a training is interrupted.

    Raises:
        Interrupted: Ctrl-C was typed, which the trainer turns into an exit.
    """
    try:
        yield
    except (KeyboardInterrupt, SystemExit) as stop:
        cause: BaseException | None = stop
        while cause is not None and not isinstance(cause, KeyboardInterrupt):
            cause = cause.__cause__ or cause.__context__
        if cause is None:
            raise
        kept = "nothing of this training is kept yet"
        if run.last_checkpoint.exists():
            kept = f"the training up to its last whole epoch is kept in {run.last_checkpoint}"
        raise Interrupted(kept) from None
