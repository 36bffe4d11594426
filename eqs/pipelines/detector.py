"""The detector of a configuration: built, described in checkpoints, found again when trained."""

from __future__ import annotations

from typing import Any, cast

from omegaconf import DictConfig, OmegaConf
from torch import nn

from eqs.models.checkpoint import load_trained
from eqs.models.protocol import require_detector
from eqs.models.settings import built
from eqs.models.trained import SETTINGS
from eqs.pipelines.runs import Run


def build_detector(cfg: DictConfig) -> nn.Module:
    """The configured detector, compiled where that is asked for.

    Raises:
        ValueError: there is no such class, it does not take these settings, or it is no detector.
    """
    model = built(plain(cfg.model))
    require_detector(model)
    if cfg.compile:
        compile_stages = getattr(model, "compile_stages", None)
        if compile_stages is None:
            raise ValueError(
                f"Expected a detector with compile_stages, got a {type(model).__name__} without; "
                "set compile=false"
            )
        compile_stages()
    return model


def settings_of(cfg: DictConfig) -> dict[str, Any]:
    """What builds the configured detector again; its weights come from elsewhere then."""
    settings = plain(cfg.model)
    return {**settings, "weights": None} if "weights" in settings else settings


def record_of(cfg: DictConfig) -> dict[str, Any]:
    """What checkpoints of a training say of its detector."""
    binning = {name: cfg.datamodule[name] for name in ("bins", "window_us", "count_cutoff")}
    return {SETTINGS: settings_of(cfg), **binning}


def trained_detector(run: Run) -> nn.Module:
    """The detector of a finished training, in evaluation mode.

    Raises:
        ValueError: its class is not here any more, or the weights are not its own.
    """
    model = built(settings_of(run.config()))
    load_trained(model, run.weights)
    return model.eval()


def plain(node: DictConfig) -> dict[str, Any]:
    """A part of a configuration as plain values, with every interpolation resolved."""
    return cast(dict[str, Any], OmegaConf.to_container(node, resolve=True))
