"""Where a training goes on: at its own newest checkpoint, a given one, or a shorter training's."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf
from torch import nn

from eqs.models.checkpoint import check_resumable
from eqs.pipelines.recipe import apart, differences, recipe
from eqs.pipelines.runs import Run
from eqs.training import IDENTITY

log = logging.getLogger(__name__)
LISTED = 4  # differences that a sentence names
# Settings that follow from the number of epochs.
FOLLOW_EPOCHS = {
    "total_steps", "recipe.epochs", "datamodule.epochs", "trainer.max_epochs",
    "task.scheduler.total_steps",
}  # fmt: skip
# What an identity says beside the recipe.
NAMED_APART = ("stream", "data", "seed", "total_steps")


def identity_of(cfg: DictConfig, stream: str, data: str) -> dict[str, Any]:
    """What a checkpoint says of its training: stream, data, seed, steps and every setting."""
    steps = cfg.recipe.epochs * cfg.recipe.steps_per_epoch
    named = dict(zip(NAMED_APART, (stream, data, cfg.seed, steps), strict=True))
    return {**named, **recipe(cfg)}


def checkpoint_path(
    cfg: DictConfig, run: Run, shorter: Run | None, identity: Mapping[str, Any], model: nn.Module
) -> Path | None:
    """Where to go on, or None to begin; the checkpoint is one of this very training.

    Args:
        cfg: a training's configuration.
        run: where its checkpoints lie.
        shorter: the training that this one goes on from for longer, if it does.
        identity: what its checkpoints say of it.
        model: the detector that is trained.

    Raises:
        FileNotFoundError: that of the shorter training does not exist.
        ValueError: the checkpoint belongs to another training, or is none.
    """
    own = run.last_checkpoint
    if own.exists() and not cfg.overwrite and cfg.ckpt_path in (None, "last"):
        compare(own, check_resumable(model, own), identity)
        log.info("going on from %s; overwrite=true begins anew", own)
        return own
    if cfg.ckpt_path not in (None, "last"):
        path = Path(cfg.ckpt_path)
        compare(path, check_resumable(model, path), identity)
        return path
    if shorter is not None:
        path = shorter.last_checkpoint
        if not (shorter.finished and path.is_file()):
            raise FileNotFoundError(
                f"Expected the finished training of {cfg.recipe.extends_epochs} epochs at "
                f"{shorter.folder}, found none; train it first, or set recipe.extends_epochs=null"
            )
        compare(path, check_resumable(model, path), identity_of_shorter(cfg, identity))
        return path
    for other in shorter_ones(run, identity):
        log.warning(
            "beginning anew; %s holds the same training of %s epochs, which "
            "recipe.extends_epochs goes on from",
            other.folder,
            other.recipe()["recipe.epochs"],
        )
    return None


def check_checkpoint(cfg: DictConfig) -> None:
    """See that a checkpoint that is named is there, before there is a data set.

    Raises:
        FileNotFoundError: it is not.
    """
    if cfg.ckpt_path not in (None, "last") and not Path(cfg.ckpt_path).is_file():
        raise FileNotFoundError(
            f"Expected a checkpoint at {cfg.ckpt_path}, found none; set ckpt_path"
        )


def shorter_ones(run: Run, identity: Mapping[str, Any]) -> list[Run]:
    """Finished trainings that this one could go on from, the longest first."""
    found = []
    for path in run.folder.parent.glob("*/result.json"):
        other = Run(path.parent)
        there = other.recipe()
        changed = apart(there, identity)
        if "recipe.epochs" in changed and changed <= FOLLOW_EPOCHS:
            found.append((there["recipe.epochs"], other))
    shorter = [each for each in found if each[0] < identity["recipe.epochs"]]
    return [other for _, other in sorted(shorter, key=lambda each: -each[0])[:1]]


def compare(path: Path, content: Mapping[str, Any], identity: Mapping[str, Any]) -> None:
    """Refuse the checkpoint of another training.

    Raises:
        ValueError: stream, data, seed, steps or a setting differ, or nobody noted them.
    """
    stored = content.get(IDENTITY)
    if stored is None:
        raise ValueError(
            f"Expected a checkpoint that says which training it belongs to, got {path} of an "
            "older version; set overwrite=true to begin anew, or model.weights to start from it"
        )
    found = differences(stored, identity)
    if found:
        more = f" and {len(found) - LISTED} more" if len(found) > LISTED else ""
        raise ValueError(
            f"Expected a checkpoint of this training in {path}, got one with "
            f"{', '.join(found[:LISTED])}{more}; to go on set the same, to go on for longer set "
            "recipe.extends_epochs, to start from its weights set model.weights"
        )


def shorter_config(cfg: DictConfig) -> DictConfig | None:
    """The configuration of the training that is extended, if one is.

    Raises:
        ValueError: it is not shorter.
    """
    epochs = cfg.recipe.extends_epochs
    if epochs is None:
        return None
    if not isinstance(epochs, int) or not 0 < epochs < cfg.recipe.epochs:
        raise ValueError(
            f"Expected a training of fewer than {cfg.recipe.epochs} epochs to extend, got "
            f"{epochs!r}; set recipe.extends_epochs or recipe.epochs"
        )
    shorter = OmegaConf.merge(cfg, {"recipe": {"epochs": epochs, "extends_epochs": None}})
    assert isinstance(shorter, DictConfig)
    return shorter


def identity_of_shorter(cfg: DictConfig, identity: Mapping[str, Any]) -> dict[str, Any]:
    """What the checkpoints of the training that is extended say of it."""
    shorter = shorter_config(cfg)
    assert shorter is not None
    return identity_of(shorter, identity["stream"], identity["data"])
