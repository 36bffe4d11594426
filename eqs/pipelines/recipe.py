"""What makes trainings the same: every setting that changes a number, and what the data hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from omegaconf import DictConfig, OmegaConf

from eqs.content import content_hash
from eqs.data import Dataset
from eqs.files import short_hash
from eqs.models.checkpoint import weights_file

VERSION = 1  # raised whenever equal settings begin to train other detectors

WEIGHTS = "model.weights"  # the key under which a recipe holds what weights it starts from
# Parts of the configuration on which a training depends, beside its stream and its seed ...
PARTS = ("data", "protocol", "model", "recipe", "datamodule", "task", "trainer", "callbacks")
# ... and, here alone, what changes no number: where files lie (their content counts, see
# `data_hash`), on what and by how many processes it is computed, and what is shown of it. Neither
# do `jobs`, `compile`, `logger` and `paths`. Results differ between devices by rounding alone.
INCIDENTAL = {
    "data": {
        "root", "generator", "workers", "scored", "first_frames", "event_view", "converted",
        "hints",
    },
    "datamodule": {"seed", "num_workers", "histogram_cache", "evaluation_length"},
    "trainer": {
        "accelerator", "devices", "num_nodes", "strategy", "plugins", "logger", "callbacks",
        "default_root_dir", "enable_checkpointing", "enable_progress_bar", "enable_model_summary",
        "enable_autolog_hparams", "log_every_n_steps", "num_sanity_val_steps", "inference_mode",
        "profiler", "detect_anomaly", "barebones", "use_distributed_sampler", "sync_batchnorm",
    },
    "callbacks": {"progress", "learning_rate", "pictures", "lines"},
}  # fmt: skip
# Settings of the trainer that try a training out instead of doing it.
TRIALS = (
    "fast_dev_run", "overfit_batches", "limit_train_batches", "limit_val_batches",
    "limit_test_batches", "limit_predict_batches",
)  # fmt: skip


def recipe(cfg: DictConfig) -> dict[str, Any]:
    """Every setting that changes a number, by its key; weights to start from by their content.

    Raises:
        FileNotFoundError: there are no such weights.
    """
    found: dict[str, Any] = {"version": VERSION}
    for part in PARTS:
        for name, value in (cfg.get(part) or {}).items():
            if name not in INCIDENTAL.get(part, ()):
                config = OmegaConf.is_config(value)
                plain = OmegaConf.to_container(value, resolve=True) if config else value
                found |= _flat(plain, f"{part}.{name}")
    weights = cfg.model.get("weights")
    if weights is not None:
        file = weights_file(weights)
        if not file.is_file():
            raise FileNotFoundError(
                f"Expected weights to start from at {file}, found none; set model.weights"
            )
        found[WEIGHTS] = content_hash(file)
    return found


def recipe_hash(cfg: DictConfig) -> str:
    """Hash of the recipe: equal for runs that differ only in stream, seed and data."""
    return short_hash(recipe(cfg))


def data_hash(data: Dataset) -> str:
    """Hash of what every recording holds, frames, times, labels and events, split by split."""
    splits = {
        split: [data.load(places) for places in sequences]
        for split, sequences in data.sequences().items()
    }
    data.make_events([recording for held in splits.values() for recording in held])
    return short_hash(
        {split: [each.content_hash() for each in held] for split, held in splits.items()}
    )


def apart(there: Mapping[str, Any], here: Mapping[str, Any]) -> set[str]:
    """The settings in which one recipe differs from another."""
    return {key for key in there.keys() | here.keys() if there.get(key) != here.get(key)}


def differences(there: Mapping[str, Any], here: Mapping[str, Any]) -> list[str]:
    """How one recipe differs from another, setting by setting.

    Example:
        >>> differences({"recipe.epochs": 12}, {"recipe.epochs": 24})
        ['recipe.epochs 12 instead of 24']
    """
    return [
        f"{key} {there.get(key)} instead of {here.get(key)}" for key in sorted(apart(there, here))
    ]


def trials(cfg: DictConfig) -> list[str]:
    """Settings that only try the training out, whose numbers are no result."""
    chosen = {name: cfg.trainer.get(name) for name in TRIALS}
    # One batch is a trial, the share 1.0 is all of them.
    whole = [each for each, value in chosen.items() if isinstance(value, float) and value == 1.0]
    return [f"trainer.{name}" for name, value in chosen.items() if value and name not in whole]


def _flat(value: object, key: str) -> dict[str, Any]:
    if isinstance(value, dict) and value:
        parts = [_flat(inner, f"{key}.{name}") for name, inner in value.items()]
        return {name: inner for part in parts for name, inner in part.items()}
    return {key: value}
