"""What a command scores with: the judge that is found, made or given, and what it reads."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from hydra.utils import instantiate
from omegaconf import DictConfig

from eqs.data import DSECFolder
from eqs.events import EventReader
from eqs.metrics import EventQualityScore, Judge, Reading, StreamScore
from eqs.metrics.definition import choices
from eqs.metrics.judge_folder import RECORD
from eqs.metrics.scoring import Watcher
from eqs.pipelines.build import Dataset
from eqs.pipelines.runs import Run, finished_runs, recipe_hash

log = logging.getLogger(__name__)
EMBEDDED_DATA = "dsec_mini"
# Activations whose mean real feature a trained judge keeps, for whoever reads them later.
KEPT_TAPS = ("hidden", "gate", "downsample")


@dataclass(frozen=True, kw_only=True)
class Scoring:
    """The metric of a command with every reading that it reports.

    Args:
        metric: the headline, on the device that scores.
        readings: every reading, the headline first.
    """

    metric: EventQualityScore
    readings: tuple[Reading, ...]

    @property
    def judge(self) -> Judge:
        """Network, hashes and description of what scores."""
        return self.metric.judge

    @property
    def headline(self) -> Reading:
        """The reading that is the column `eqs`."""
        return self.metric.reading

    def score(
        self,
        real: EventReader | Any,  # noqa: ANN401
        candidates: Sequence[Any],
        *,
        start_us: int,
        stop_us: int,
        watch: Watcher | None = None,
    ) -> list[dict[str, StreamScore]]:
        """Every reading of every candidate, in one pass of the judge."""
        limits = {"start_us": start_us, "stop_us": stop_us}
        return self.metric.score(real, candidates, self.readings, **limits, watch=watch)


def find_scoring(cfg: DictConfig, data: Dataset | None) -> Scoring:
    """The configured judge and choices, with the centres that they need.

    Args:
        cfg: a configuration with `eqs`, `taps` and `device`.
        data: the data set, whose training recordings a judge without centres is centred on.

    Raises:
        ValueError: there is no judge, or no such device, or a choice does not fit the judge.
    """
    device = scoring_device(cfg.device)
    judge, folder, training = find_judge(cfg, data)
    judge.to(device)
    chosen = {name: cfg.eqs[name] for name in choices() if cfg.eqs[name] is not None}
    definition = judge.define(**chosen)
    taps = list(dict.fromkeys([definition.tap, *cfg.taps]))
    missing = [tap for tap in taps if judge.centre_for(replace(definition, tap=tap)) is None]
    if missing and training is not None:
        judge = centred(judge, training, missing, cfg.eqs.chunk_windows, chosen)
        judge.save(folder)
    # Partial, since Hydra would take the judge for a configuration and open it.
    metric = instantiate(cfg.eqs, _partial_=True)(judge=judge).to(device)
    return Scoring(metric=metric, readings=readings_of(metric, taps))


def find_judge(cfg: DictConfig, data: Dataset | None) -> tuple[Judge, Path, Dataset | None]:
    """The judge that is named, or a detector trained on the real stream of this data.

    Of several detectors the one that followed the configured recipe is taken, else the newest.

    Returns:
        The judge, the folder that keeps it, and the data to centre it on where that is known.

    Raises:
        ValueError: none is named and no detector was trained on a real stream.
    """
    if cfg.eqs.judge is not None:
        return _given_judge(cfg, data)
    for name in dict.fromkeys([cfg.data.name, EMBEDDED_DATA]):
        found = finished_runs(Path(cfg.paths.runs) / name)
        trained = [run for run in found if run.result.simulator == "real"]
        if trained:
            recipe = recipe_hash(cfg)
            ranks = {(run.result.recipe == recipe, run.finished_ns): run for run in trained}
            run = ranks[max(ranks)]
            if name != cfg.data.name:
                log.warning(
                    "The judge was trained on %s, another world than %s: its scores rank streams, "
                    "but their level means little; set eqs.judge to one trained on such data",
                    name,
                    cfg.data.name,
                )
            return judge_of(run), run.folder, _data_of(run)
    raise ValueError(
        "Expected a judge trained on real events, got none: type `python train.py sim=real` first, "
        "or set eqs.judge to a judge's folder or a checkpoint"
    )


def _given_judge(cfg: DictConfig, data: Dataset | None) -> tuple[Judge, Path, Dataset | None]:
    judge = Judge.load(cfg.eqs.judge, cfg.eqs.partition_split_32)
    place = Path(cfg.eqs.judge)
    folder = place if place.is_dir() else place.parent
    if (folder / RECORD).is_file():
        run = Run(folder)
        return judge, folder, _data_of(run) if run.finished else data
    folder = Path(cfg.paths.results) / cfg.data.name / f"judge-{judge.weights_sha256[:12]}"
    if (folder / RECORD).is_file():
        judge = Judge.load(folder)
    return judge, folder, data if isinstance(data, DSECFolder) else None


def judge_of(run: Run) -> Judge:
    """The judge of a training on real events, made from its weights where it is not there yet."""
    if not (run.folder / RECORD).is_file():
        config = run.config()
        write_judge(config, run, _data_of(run), scoring_device("auto"))
    return Judge.load(run.folder)


def _data_of(run: Run) -> Dataset:
    data: Dataset = instantiate(run.config().data)
    return data


def write_judge(cfg: DictConfig, run: Run, data: Dataset, device: torch.device) -> None:
    """Make a judge of a detector trained on real events and keep it in the run's folder.

    Args:
        cfg: the configuration of the training.
        run: the training, whose weights are there.
        data: the data set, whose training recordings the judge is centred on.
        device: where the features are computed.
    """
    judge = Judge.from_checkpoint(run.weights, cfg.model.partition_split_32).to(device)
    binning = {name: cfg.datamodule[name] for name in ("window_us", "count_cutoff")}
    world = "a rendered world" if cfg.data.name.startswith(EMBEDDED_DATA) else "real recordings"
    judge = replace(
        judge,
        definition=judge.define(**binning),
        description=f"RVT-{cfg.model.size} trained on the recorded events of {cfg.data.name}, "
        f"{world}",
    )
    centred(judge, data, KEPT_TAPS, None, {}).save(run.folder)


def centred(
    judge: Judge,
    data: Dataset,
    taps: Sequence[str],
    chunk_windows: int | None,
    chosen: dict[str, Any],
) -> Judge:
    """The judge with centres of more activations, computed on a data set's training recordings."""
    data.prepare()
    with ExitStack() as stack:
        streams = (
            stack.enter_context(EventReader(r.events_path, r.height, r.width, data.crop_rows))
            for r in data.recordings("train")
        )
        return judge.centred_on(streams, taps, chunk_windows=chunk_windows, **chosen)


def readings_of(metric: EventQualityScore, taps: Sequence[str]) -> tuple[Reading, ...]:
    """The metric's own reading, then every tap raw and, where there are centres, otherwise too."""
    judge, headline = metric.judge, metric.reading.definition
    kinds = ["raw", *sorted({"centred", headline.features} - {"raw"})]
    readings = []
    for features in kinds:
        for tap in taps:
            definition = replace(headline, tap=tap, features=features)
            centre = None if features == "raw" else judge.centre_for(definition)
            if features == "raw" or centre is not None:
                readings.append(Reading(definition=definition, centre=centre))

    def distance_to_headline(reading: Reading) -> tuple[bool, bool]:
        chosen = reading.definition
        return chosen.tap != headline.tap, chosen.features != headline.features

    return tuple(sorted(readings, key=distance_to_headline))


def scoring_device(name: str) -> torch.device:
    """Where scores are computed: `auto` takes a GPU where there is one.

    Raises:
        ValueError: there is no such device here.
    """
    if name == "auto":
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    try:
        return torch.empty(0, device=name).device
    except (RuntimeError, AssertionError) as error:
        raise ValueError(
            f"Expected device auto, cpu or a GPU that is there, got {name!r} "
            f"({str(error).splitlines()[0]}); set device"
        ) from error
