"""The judge of a command: found among the trainings, made of one, or given."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import torch
from hydra.utils import instantiate
from omegaconf import DictConfig

from eqs.data import Dataset
from eqs.events import EventReader
from eqs.files import short_hash
from eqs.metrics import Judge
from eqs.metrics.features import NAMED, tap_names
from eqs.metrics.judge import place_of, shipped
from eqs.metrics.judge_folder import RECORD
from eqs.metrics.network import OwnNetwork
from eqs.models import RVTDetector
from eqs.models.settings import class_of
from eqs.pipelines.detector import plain, settings_of
from eqs.pipelines.recipe import data_hash, recipe_hash
from eqs.pipelines.runs import Run, finished_runs
from eqs.pipelines.sensors import results_folder, sensor_label, sensor_of

log = logging.getLogger(__name__)
EMBEDDED_DATA = "dsec_mini"
# Activations of an RVT whose mean real feature a trained judge keeps, for whoever reads them later.
KEPT_TAPS = ("hidden", "gate", "downsample")


class Found(NamedTuple):
    """A judge and where it comes from.

    Args:
        judge: the judge.
        folder: where centres that it lacks are kept.
        training: the data to centre it on, where that is known.
        given: hashes of centres that came with it and stay, whatever data there are.
    """

    judge: Judge
    folder: Path
    training: Dataset | None
    given: frozenset[str] = frozenset()


def require_judge(cfg: DictConfig) -> None:
    """See that the judge that is named, and the device, are there before there is a data set.

    Raises:
        FileNotFoundError: the named judge does not exist.
        ValueError: there is no such device here.
    """
    scoring_device(cfg.device)
    if isinstance(cfg.eqs.judge, DictConfig):
        class_of(cfg.eqs.judge, "eqs.judge")
    elif cfg.eqs.judge not in (None, "random") and not place_of(cfg.eqs.judge).exists():
        raise FileNotFoundError(
            f"Expected a judge at {cfg.eqs.judge}, or the package's {', '.join(shipped())}, found "
            "neither; set eqs.judge"
        )


def trained_on_real(cfg: DictConfig) -> list[Run]:
    """Detectors trained on the real stream of the configured data, or else of the embedded ones.

    Those that can judge, that is.
    """
    for name in dict.fromkeys([cfg.data.name, EMBEDDED_DATA]):
        found = finished_runs(Path(cfg.paths.runs) / name)
        trained = [run for run in found if run.result.simulator == "real" and can_judge(run)]
        if trained:
            return trained
    return []


def can_judge(run: Run) -> bool:
    """Whether a training left a judge, or a detector that shows its inner maps."""
    if (run.folder / RECORD).is_file():
        return True
    try:
        own = own_settings(run.config())
        return own is None or _shows_maps(own)
    except ValueError:  # its class is not here any more
        return False


def own_settings(cfg: DictConfig) -> dict[str, Any] | None:
    """What builds a detector of somebody's own again; None for an RVT, whose backbone judges.

    Raises:
        ValueError: there is no such class.
    """
    settings = settings_of(cfg)
    return None if issubclass(class_of(settings), RVTDetector) else settings


def _shows_maps(settings: Mapping[str, Any]) -> bool:
    return hasattr(class_of(settings), "taps")


def find_judge(cfg: DictConfig, data: Dataset | None) -> Found:
    """The judge that is named, else a detector trained on the real stream of this data.

    Of several detectors one of the chosen sensor is taken, and among these the one that followed
    the configured recipe on the data as they are, else the newest; where there is none, the judge
    that comes with the package.

    Raises:
        FileNotFoundError: the named judge does not exist.
    """
    require_judge(cfg)
    if cfg.eqs.judge is not None:
        return _given_judge(cfg, data)
    found = trained_on_real(cfg)
    if not found:
        name = shipped()[0]
        log.info("judge: %s, which comes with the package", name)
        return Found(Judge.load(name), Path(cfg.paths.results) / f"judge-{name}", None)
    recipe, sensor = recipe_hash(cfg), sensor_label(cfg)
    alike = [run.result.sensor == sensor for run in found]
    content = data_hash(data) if data is not None and any(alike) else None
    ranks = {
        (same, run.result.recipe == recipe, run.result.data == content, run.finished_ns): run
        for same, run in zip(alike, found, strict=True)
    }
    run = ranks[max(ranks)]
    name = run.folder.parents[1].name
    if name != cfg.data.name:
        log.warning(
            "The judge was trained on %s, another world than %s: its scores rank streams, but "
            "their level means little; set eqs.judge to one trained on such data",
            name,
            cfg.data.name,
        )
    elif run.result.sensor != sensor:
        log.warning(
            "The judge was trained on the real events of %s: its scores rank streams; "
            "train.py sim=real makes one for the sensor that is chosen",
            run.result.sensor or "the data set's own sensor",
        )
    elif content is not None and run.result.data != content:
        log.warning(
            "The judge was trained when %s held other recordings; train.py sim=real makes one for "
            "those that are there now",
            name,
        )
    return Found(judge_of(run), run.folder, _data_of(run))


def _given_judge(cfg: DictConfig, data: Dataset | None) -> Found:
    if isinstance(cfg.eqs.judge, DictConfig):
        judge = Judge.built(plain(cfg.eqs.judge))
        return _with_kept_centres(cfg, judge, data)
    judge = Judge.load(cfg.eqs.judge, cfg.eqs.partition_split_32)
    if str(cfg.eqs.judge) in shipped():
        return Found(judge, Path(cfg.paths.results) / f"judge-{cfg.eqs.judge}", None)
    place = Path(cfg.eqs.judge)
    run = Run(place if place.is_dir() else place.parent)
    if run.finished and (run.folder / RECORD).is_file():
        return Found(judge, run.folder, _data_of(run))
    return _with_kept_centres(cfg, judge, data)


def _with_kept_centres(cfg: DictConfig, judge: Judge, data: Dataset | None) -> Found:
    # A judge that somebody made stays as it is; what it lacks here is kept with our results.
    given = frozenset(centre.sha256 for centre in judge.centres)
    name = f"judge-{judge.weights_sha256[:12]}"
    if isinstance(judge.network, OwnNetwork):  # of which equal weights may compute another thing
        name += f"-{judge.network.architecture}"
    folder = results_folder(cfg) / name
    if (folder / RECORD).is_file():
        kept = Judge.load(folder)
        made = tuple(centre for centre in kept.centres if centre.sha256 not in given)
        judge = replace(judge, centres=(*judge.centres, *made)) if given else kept
    labelled = data is not None and "train" in data.split_names
    return Found(judge, folder, data if labelled else None, given)


def training_content(data: Dataset | None) -> str:
    """Hash of what the training recordings hold; empty where there are none to be read."""
    if data is None:
        return ""
    try:
        recordings = data.recordings("train")
        data.make_events(recordings)
        return short_hash([recording.content_hash() for recording in recordings])
    except (ValueError, OSError):  # not there any more, or never labelled to be trained on
        return ""


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

    A detector without taps is none, and a line says so.

    Args:
        cfg: the configuration of the training.
        run: the training, whose weights are there.
        data: the data set, whose training recordings the judge is centred on.
        device: where the features are computed.
    """
    own = own_settings(cfg)
    if own is not None and not _shows_maps(own):
        log.info(
            "no judge is written: the network %s has no taps; one with %s would be kept as a judge",
            class_of(own).__name__,
            ", ".join(NAMED),
        )
        return
    split = None if own is not None else cfg.model.partition_split_32
    judge = Judge.from_checkpoint(run.weights, split, own).to(device)
    named = f"RVT-{cfg.model.size}" if own is None else class_of(own).__name__
    binning = {name: cfg.datamodule[name] for name in ("window_us", "count_cutoff")}
    sensor = sensor_of(data)
    world = "real recordings" if sensor is None else f"a rendered world seen by {sensor.words}"
    judge = replace(
        judge,
        definition=judge.define(**binning),
        description=f"{named} trained on the recorded events of {cfg.data.name}, {world}",
    )
    centred(judge, data, kept_taps(judge), None, {}).save(run.folder)


def kept_taps(judge: Judge) -> Sequence[str]:
    """Activations that are centred and scored where nobody chooses: all that a network names."""
    return tap_names(judge.backbone) if hasattr(judge.backbone, "tap_names") else KEPT_TAPS


def centred(
    judge: Judge,
    data: Dataset,
    taps: Sequence[str],
    chunk_windows: int | None,
    chosen: dict[str, Any],
) -> Judge:
    """The judge with centres of more activations, computed on a data set's training recordings."""
    data.prepare()
    recordings = data.recordings("train")
    data.make_events(recordings)
    with ExitStack() as stack:
        streams = (
            stack.enter_context(EventReader(r.events_path, r.height, r.width, data.crop_rows))
            for r in recordings
        )
        return judge.centred_on(
            streams, taps, chunk_windows=chunk_windows, content=training_content(data), **chosen
        )


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
