"""Train one detector: data, events, fit, test on the own and the real stream."""

from __future__ import annotations

import logging
import shutil
import time
from pathlib import Path

import lightning
import torch
from hydra.utils import instantiate
from lightning.pytorch.callbacks import Callback, ModelCheckpoint
from omegaconf import DictConfig
from rich.console import Console

from eqs.data import EventSource, LabelProtocol, RecordedEvents
from eqs.files import short_hash
from eqs.models.checkpoint import check_resumable
from eqs.pipelines.build import event_source
from eqs.pipelines.command import explained
from eqs.pipelines.judge import write_judge
from eqs.pipelines.prepare import prepare_data, prepare_stream
from eqs.pipelines.result import RunResult
from eqs.pipelines.runs import Run, recipe_hash
from eqs.pipelines.timing import PhaseTimes, phase_times
from eqs.processors import available_cores
from eqs.training import DetectionTask

log = logging.getLogger(__name__)


@explained
def train(cfg: DictConfig) -> RunResult:
    """Train and test as configured; a finished run is reported, not repeated."""
    source = event_source(cfg.sim, cfg)
    runs = Path(cfg.paths.runs) / cfg.data.name
    run = Run(runs / source.label / f"{recipe_hash(cfg)}-seed{cfg.seed}")
    if run.finished and not cfg.overwrite:
        log.info("%s is finished already; overwrite=true trains it again", run.folder)
    else:
        execute(cfg, run, source, phase_times(cfg))
    show(run.result)
    return run.result


def execute(cfg: DictConfig, run: Run, source: EventSource, times: PhaseTimes) -> None:
    """Do the work of one run and record what it measured."""
    lightning.seed_everything(cfg.seed, workers=True, verbose=False)
    torch.set_num_threads(max(1, available_cores() // cfg.jobs))
    tests: dict[str, EventSource] = {"own": source, "real": RecordedEvents()}
    if isinstance(source, RecordedEvents):
        del tests["own"]  # on the recorded events both tests are the same one
    protocol = instantiate(cfg.protocol)
    task = build_task(cfg, protocol, list(tests))
    checkpoint = checkpoint_path(cfg, run)
    if checkpoint is not None:
        check_resumable(task.model, checkpoint)
    data = prepare_data(cfg, times)
    prepare_stream(source, data, times)
    if cfg.overwrite:  # only now: everything that can be refused was looked at
        shutil.rmtree(run.folder, ignore_errors=True)
    run.save_config(cfg)
    datamodule = instantiate(cfg.datamodule)(
        dataset=data, protocol=protocol, source=source, tests=tests
    )
    trainer = build_trainer(cfg, run)
    with times.measure(f"train {source.name}", resumed=checkpoint is not None):
        start = time.perf_counter()
        trainer.fit(task, datamodule, ckpt_path=checkpoint)
        trainer.save_checkpoint(run.weights, weights_only=True)
        trainer.test(task, datamodule, verbose=False)
        seconds = time.perf_counter() - start
    if isinstance(source, RecordedEvents) and trainer.is_global_zero:
        with times.measure("judge"):
            write_judge(cfg, run, data, trainer.strategy.root_device)
    real, card = task.measured["real"], protocol.card()
    run.finish(
        RunResult(
            simulator=source.name,
            system=source.label,
            seed=cfg.seed,
            recipe=recipe_hash(cfg),
            own=task.measured.get("own", real),  # a detector of real events has one test
            real=real,
            protocol={**card, "hash": short_hash(card)},
            seconds=round(seconds, 1),
        )
    )


def build_task(cfg: DictConfig, protocol: LabelProtocol, test_streams: list[str]) -> DetectionTask:
    """The configured detector in its training module."""
    model = instantiate(cfg.model)
    if cfg.compile:
        model.compile_stages()
    build = instantiate(cfg.task)
    task: DetectionTask = build(model=model, protocol=protocol, test_streams=test_streams)
    return task


def build_trainer(cfg: DictConfig, run: Run) -> lightning.Trainer:
    """The configured trainer, writing into the run's folder."""
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
    callbacks: list[Callback] = [last, best, *instantiate(cfg.callbacks).values()]
    loggers = [logger(save_dir=run.folder) for logger in instantiate(cfg.logger).values()]
    trainer: lightning.Trainer = instantiate(cfg.trainer, callbacks=callbacks, logger=loggers)
    return trainer


def checkpoint_path(cfg: DictConfig, run: Run) -> Path | None:
    """Where to resume: the run's newest checkpoint, a given file, or nowhere.

    Raises:
        FileNotFoundError: the given file does not exist.
    """
    if cfg.ckpt_path is None:
        return None
    if cfg.ckpt_path == "last":
        return run.last_checkpoint if run.last_checkpoint.exists() and not cfg.overwrite else None
    path = Path(cfg.ckpt_path)
    if not path.is_file():
        raise FileNotFoundError(f"Expected a checkpoint at {path}, found none; set ckpt_path")
    return path


def show(result: RunResult) -> None:
    """Print both mAPs of a run."""
    own, real = result.own, result.real
    Console().print(
        f"[bold]{result.system}[/bold] seed {result.seed}: "
        f"own test mAP {100 * own.map:.1f} (AP50 {100 * own.map_50:.1f}), "
        f"real test mAP {100 * real.map:.1f} (AP50 {100 * real.map_50:.1f})"
    )
