"""The judge of a study: one frozen backbone and its mean real features, the same for everyone."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from hydra.utils import instantiate
from omegaconf import DictConfig

from eqs.data import DSECFolder, Recording
from eqs.events import EventReader
from eqs.metrics import (
    Centre,
    Definition,
    Reading,
    TappedBackbone,
    feature_centres,
    load_backbone,
)
from eqs.pipelines.build import Dataset
from eqs.pipelines.runs import Run, finished_runs, recipe_hash

log = logging.getLogger(__name__)
EMBEDDED_DATA = "dsec_mini"
# What an EQS configuration says about the definition; the rest says where the judge is.
CHOICES = (
    "tap", "features", "stages", "patch", "patch_size", "pooling", "mask",
    "state", "bins", "window_us", "count_cutoff", "span", "counts", "warmup_windows",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Judge:
    """What scores every simulator of a study.

    Args:
        backbone: the frozen network.
        weights_sha256: hash of its weights.
        readings: every reading that is reported, the headline first.
        description: what it was trained on, in a sentence.
        untrained: the same network with seeded random weights, the control of the headline.
    """

    backbone: TappedBackbone
    weights_sha256: str
    readings: tuple[Reading, ...]
    description: str
    untrained: TappedBackbone

    @property
    def headline(self) -> Reading:
        """The reading that is the column `eqs`."""
        return self.readings[0]


def find_judge(cfg: DictConfig, data: Dataset | None) -> Judge:
    """The configured judge, or a detector trained on the real stream of this data.

    Of several the one that followed the configured recipe is taken, else the newest.

    Raises:
        ValueError: no weights are given and no detector was trained on a real stream, or a centre
            is given without weights or of another activation than the headline's.
    """
    if cfg.eqs.weights is not None:
        return _given_judge(cfg, data)
    if cfg.eqs.centre is not None:
        raise ValueError(
            f"Expected weights beside the centre {cfg.eqs.centre}, got none: a centre belongs to "
            "one judge; set eqs.weights"
        )
    for name in dict.fromkeys([cfg.data.name, EMBEDDED_DATA]):
        found = finished_runs(Path(cfg.paths.runs) / name)
        trained = [run for run in found if run.result()["simulator"] == "real"]
        if trained:
            recipe = recipe_hash(cfg)
            ranks = {(run.result()["recipe"] == recipe, run.finished_ns): run for run in trained}
            return _trained_judge(cfg, ranks[max(ranks)])
    raise ValueError(
        "Expected a judge trained on real events, got none: type `python train.py sim=real` first, "
        "or set eqs.weights to a checkpoint"
    )


def _trained_judge(cfg: DictConfig, run: Run) -> Judge:
    config = run.config()
    definition = _definition(cfg, config.model.size, config.model.partition_split_32)
    backbone, digest = load_backbone(
        run.weights,
        size=config.model.size,
        bins=definition.bins,
        partition_split_32=config.model.partition_split_32,
    )
    if config.data.name != cfg.data.name:
        log.warning(
            "The judge was trained on %s, another world than %s: its scores rank streams, but "
            "their level means little; set eqs.weights to a judge trained on such data",
            config.data.name,
            cfg.data.name,
        )
    taps = list(dict.fromkeys([cfg.eqs.tap, *cfg.taps]))
    centres = _stored_centres(run.folder, taps, definition)
    if centres is None:
        data = instantiate(config.data)
        data.prepare()
        centres = _new_centres(backbone, data.recordings("train"), taps, definition, run.folder)
    world = "a rendered world" if config.data.name.startswith(EMBEDDED_DATA) else "real recordings"
    return Judge(
        backbone=backbone,
        weights_sha256=digest,
        readings=_readings(taps, definition, centres),
        description=f"RVT-{config.model.size} trained on the recorded events of "
        f"{config.data.name}, {world}",
        untrained=_untrained(cfg, config.model),
    )


def _given_judge(cfg: DictConfig, data: Dataset | None) -> Judge:
    definition = _definition(cfg, cfg.eqs.size, cfg.eqs.partition_split_32)
    backbone, digest = load_backbone(
        cfg.eqs.weights,
        size=cfg.eqs.size,
        bins=definition.bins,
        partition_split_32=cfg.eqs.partition_split_32,
        seed=cfg.eqs.seed,
    )
    taps = list(dict.fromkeys([cfg.eqs.tap, *cfg.taps]))
    training = data.recordings("train") if isinstance(data, DSECFolder) else []
    centres: dict[str, Centre] = {}
    if cfg.eqs.centre is not None:
        centres = _given_centre(cfg)
    elif training:
        folder = Path(cfg.paths.results) / cfg.data.name / f"judge-{digest[:12]}"
        centres = _stored_centres(folder, taps, definition) or _new_centres(
            backbone, training, taps, definition, folder
        )
    else:
        log.warning(
            "There are no real training recordings to centre on: only raw scores are reported; "
            "set eqs.centre to a file that belongs to the weights",
        )
    return Judge(
        backbone=backbone,
        weights_sha256=digest,
        readings=_readings(taps, definition, centres),
        description="random weights, a control"
        if cfg.eqs.weights == "random"
        else "weights given with eqs.weights",
        untrained=_untrained(cfg, cfg.eqs),
    )


def _given_centre(cfg: DictConfig) -> dict[str, Centre]:
    centre = Centre.load(cfg.eqs.centre)
    if centre.tap != cfg.eqs.tap:
        raise ValueError(
            f"Expected a centre of the activation {cfg.eqs.tap}, got one of {centre.tap} in "
            f"{cfg.eqs.centre}; set eqs.centre or eqs.tap"
        )
    return {centre.tap: centre}


def _untrained(cfg: DictConfig, network: DictConfig) -> TappedBackbone:
    backbone, _ = load_backbone(
        "random",
        size=network.size,
        bins=cfg.eqs.bins,
        partition_split_32=network.partition_split_32,
        seed=cfg.eqs.seed,
    )
    return backbone


def _definition(cfg: DictConfig, size: str, split: int) -> Definition:
    choices = {name: cfg.eqs[name] for name in CHOICES}
    choices["stages"] = tuple(choices["stages"])
    return Definition(**choices, architecture=f"rvt-{size}-split{split}")


def _readings(
    taps: Sequence[str], definition: Definition, centres: dict[str, Centre]
) -> tuple[Reading, ...]:
    """Every tap raw and centred, and whitened where the headline is; the headline first."""
    readings = [Reading(definition=replace(definition, tap=tap, features="raw")) for tap in taps]
    readings += [
        Reading(definition=replace(definition, tap=tap, features=features), centre=centre)
        for features in sorted({"centred", definition.features} - {"raw"})
        for tap, centre in centres.items()
    ]

    def distance_to_headline(reading: Reading) -> tuple[bool, bool]:
        chosen = reading.definition
        return chosen.tap != definition.tap, chosen.features != definition.features

    return tuple(sorted(readings, key=distance_to_headline))


def _centre_path(folder: Path, tap: str, definition: Definition) -> Path:
    """One file per tap and binning: the statistics depend on neither features nor mask."""
    centred = replace(definition, tap=tap, features="centred", mask="none")
    return folder / f"centre-{centred.hash}.npz"


def _stored_centres(
    folder: Path, taps: Sequence[str], definition: Definition
) -> dict[str, Centre] | None:
    paths = {tap: _centre_path(folder, tap, definition) for tap in taps}
    if not all(path.exists() for path in paths.values()):
        return None
    return {tap: Centre.load(path) for tap, path in paths.items()}


def _new_centres(
    backbone: TappedBackbone,
    recordings: Sequence[Recording],
    taps: Sequence[str],
    definition: Definition,
    folder: Path,
) -> dict[str, Centre]:
    with ExitStack() as stack:
        streams = (
            stack.enter_context(EventReader(r.events_path, height=r.height, width=r.width))
            for r in recordings
        )
        centres = feature_centres(backbone, streams, taps=taps, definition=definition)
    for tap, centre in centres.items():
        centre.save(_centre_path(folder, tap, definition))
    return centres
