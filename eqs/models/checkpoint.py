"""Reading weights from published and from our own checkpoints."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

STEM = "backbone.stages.0.downsample_cf2cl.conv.weight"
CLASS_BIAS = "yolox_head.cls_preds.0.bias"
CLASS_LAYERS = "yolox_head.cls_preds."
LISTED = 5
KEYS = "model.weights"
GEOMETRY = "partition_split_32"  # under which our own checkpoints keep it
PUBLISHED_SPLIT = 2
TRAINED = "model."  # before the names of what a training module holds
RECORD = "detector"  # under which our own checkpoints say what the detector is
RESUMED = {"state_dict", "optimizer_states", "lr_schedulers", "pytorch-lightning_version"}


class WeightShape(NamedTuple):
    """What the shapes of a detector's weights say about it."""

    embed_dim: int
    in_channels: int
    num_classes: int


def read_weights(path: str | Path, key: str = KEYS) -> dict[str, Tensor]:
    """Detector weights by their published names, from a file.

    Lightning checkpoints keep them under `state_dict` behind a prefix (`mdl.` in published ones);
    entries of other modules are left out. Nothing but tensors and plain values is unpickled.

    Args:
        path: checkpoint file.
        key: configuration key to name in errors.

    Raises:
        FileNotFoundError: no such file.
        ValueError: not a checkpoint, no detector in it, or several.
    """
    return _detector_in(read_content(path, key), path, key)


def partition_of(path: str | Path, given: int | None, key: str = KEYS) -> int:
    """Attention windows per side of the last stage with which a checkpoint was trained.

    No shape of a weight tells it, and with another the network computes something else.

    Args:
        path: checkpoint file; those written here know it.
        given: what the caller says; None for what the file knows, or else 2, as published.
        key: configuration key to name in errors.

    Raises:
        FileNotFoundError: no such file.
        ValueError: not a checkpoint, or the file knows another.
    """
    stored = read_content(path, key).get(GEOMETRY)
    if given is not None and stored not in (None, given):
        raise ValueError(
            f"Expected partition_split_32={stored}, with which {path} was trained, got {given}; "
            "leave eqs.partition_split_32 out"
        )
    return next((int(each) for each in (given, stored) if each is not None), PUBLISHED_SPLIT)


def weights_file(path: str | Path) -> Path:
    """The checkpoint itself, or the weights in the folder of a finished training."""
    path = Path(path)
    return path / "weights.ckpt" if path.is_dir() else path


def read_content(path: str | Path, key: str = KEYS) -> dict[str, Any]:
    """Everything in a checkpoint; nothing but tensors and plain values is unpickled.

    Args:
        path: checkpoint file, or the folder of a finished training.
        key: configuration key to name in errors.

    Raises:
        FileNotFoundError: no such file.
        ValueError: not a checkpoint.
    """
    path = weights_file(path)
    if not path.is_file():
        raise FileNotFoundError(f"Expected a checkpoint at {path}, got no such file; set {key}")
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
    except (pickle.UnpicklingError, RuntimeError, OSError, EOFError, KeyError, ValueError) as error:
        raise ValueError(
            f"Expected a checkpoint of tensors and plain values in {path}, got a file that "
            f"torch.load with weights_only=True refuses; set {key} to another file"
        ) from error
    return content if isinstance(content, dict) else {}


def _detector_in(content: dict[str, Any], path: str | Path, key: str) -> dict[str, Tensor]:
    entries = content.get("state_dict", content)
    tensors = {str(name): x for name, x in entries.items() if isinstance(x, Tensor)}
    prefixes = [name.removesuffix(STEM) for name in tensors if name.endswith(STEM)]
    if len(prefixes) != 1:
        raise ValueError(
            f"Expected one RVT detector in {path}, got {len(prefixes)} entries that end in {STEM}; "
            f"set {key} to a detector's checkpoint"
        )
    prefix = prefixes[0]
    return {name.removeprefix(prefix): x for name, x in tensors.items() if name.startswith(prefix)}


def trained_weights(content: dict[str, Any], path: str | Path) -> dict[str, Tensor]:
    """The entries of the network that our training module holds, or those of a plain file.

    Raises:
        ValueError: there are none.
    """
    stem = TRAINED if "state_dict" in content else ""
    entries = content.get("state_dict", content)
    found = {
        str(name).removeprefix(stem): x
        for name, x in entries.items()
        if str(name).startswith(stem) and isinstance(x, Tensor)
    }
    if not found:
        raise ValueError(f"Expected weights of a trained network in {path}, got none")
    return found


def load_trained(model: nn.Module, path: str | Path, key: str = KEYS) -> None:
    """Load the weights that a training left into a network of the same settings.

    Args:
        model: the network.
        path: checkpoint file.
        key: configuration key to name in errors.

    Raises:
        FileNotFoundError: no such file.
        ValueError: missing, unexpected or differently shaped entries.
    """
    weights = trained_weights(read_content(path, key), path)
    check_entries(model.state_dict(), weights, path, f"{key} to another file")
    model.load_state_dict(weights)


def shape_of(weights: dict[str, Tensor], path: str | Path) -> WeightShape:
    """Widths and class count that the weights imply.

    Raises:
        ValueError: the entries that tell them are missing.
    """
    if CLASS_BIAS not in weights:
        raise ValueError(f"Expected an entry {CLASS_BIAS} in {path}, got none")
    embed_dim, in_channels = weights[STEM].shape[:2]
    return WeightShape(embed_dim, in_channels, len(weights[CLASS_BIAS]))


def load_weights(model: nn.Module, path: str | Path, *, new_class_branch: bool = False) -> None:
    """Load a checkpoint into a detector; every entry must be there, with its shape.

    Args:
        model: the detector.
        path: checkpoint file.
        new_class_branch: leave the layers that depend on the number of classes as they are
            where that number differs.

    Raises:
        FileNotFoundError: no such file.
        ValueError: missing, unexpected or differently shaped entries.
    """
    weights = read_weights(path)
    own = model.state_dict()
    classes = len(own[CLASS_BIAS])
    stored = shape_of(weights, path).num_classes
    if stored != classes:
        if not new_class_branch:
            raise ValueError(
                f"Expected weights for {classes} classes, got {stored} in {path}; set "
                "model.new_class_branch=true to start the class layers anew"
            )
        anew = {name: x for name, x in own.items() if name.startswith(CLASS_LAYERS)}
        weights = {**weights, **anew}
    check_entries(own, weights, path)
    model.load_state_dict(weights)


def check_resumable(model: nn.Module, path: str | Path) -> dict[str, Any]:
    """The content of a checkpoint; one from which the training cannot go on is refused.

    Raises:
        FileNotFoundError: no such file.
        ValueError: not a checkpoint of a training, or one of another detector.
    """
    content, own = read_content(path, "ckpt_path"), model.state_dict()
    weights = trained_weights(content, path)
    if {CLASS_BIAS} <= own.keys() & weights.keys():
        classes, stored = len(own[CLASS_BIAS]), len(weights[CLASS_BIAS])
        if stored != classes:
            raise ValueError(
                f"Expected a training of {classes} classes to resume, got {stored} in {path}; set "
                "ckpt_path to another, or model.weights to it with model.new_class_branch=true"
            )
    keys = [] if CLASS_BIAS in own else ["what lies below model to the checkpoint's"]
    check_entries(own, weights, path, *keys)
    missing = sorted(RESUMED - content.keys())
    if missing:
        raise ValueError(
            f"Expected a training to resume in {path}, got a file without {', '.join(missing)}; "
            "set model.weights instead of ckpt_path to start from its weights"
        )
    return content


def check_entries(
    own: dict[str, Tensor],
    weights: dict[str, Tensor],
    path: str | Path,
    keys: str = "model.size and model.in_channels to the checkpoint's",
) -> None:
    """Refuse weights that are not those of a module, entry for entry.

    Args:
        own: the module's own entries.
        weights: those of the file.
        path: the file.
        keys: what to set in the error's words.

    Raises:
        ValueError: missing, unexpected or differently shaped entries.
    """
    problems = {
        "missing": [name for name in own if name not in weights],
        "unexpected": [name for name in weights if name not in own],
        "differently shaped": [
            f"{name} {tuple(weights[name].shape)} instead of {tuple(x.shape)}"
            for name, x in own.items()
            if name in weights and weights[name].shape != x.shape
        ],
    }
    if any(problems.values()):
        found = "; ".join(f"{kind}: {_shortened(names)}" for kind, names in problems.items())
        raise ValueError(
            f"Expected the {len(own)} entries of this network in {path}, got {found}; set {keys}"
        )


def _shortened(names: list[str]) -> str:
    if len(names) <= LISTED:
        return ", ".join(names) or "none"
    return f"{', '.join(names[:LISTED])} and {len(names) - LISTED} more"
