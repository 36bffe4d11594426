"""Train one detector: data, events, fit, test on the own and the real stream."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lightning
import torch
from hydra.utils import instantiate
from omegaconf import DictConfig
from rich.console import Console

from eqs.data import Dataset, EventSource, LabelProtocol, RecordedEvents
from eqs.files import one_at_a_time, short_hash
from eqs.pipelines.build import dataset, event_source
from eqs.pipelines.command import explained
from eqs.pipelines.judge import write_judge
from eqs.pipelines.prepare import prepare_data, prepare_stream
from eqs.pipelines.recipe import data_hash, recipe, recipe_hash, trials
from eqs.pipelines.result import RunResult
from eqs.pipelines.resume import check_checkpoint, checkpoint_path, identity_of, shorter_config
from eqs.pipelines.runs import Run
from eqs.pipelines.sensors import other_sensor, own_events, sensor_label
from eqs.pipelines.start import Start, start_of, trained_as
from eqs.pipelines.testing import build_task, on_other_sensor, sees_real, streams_to_test
from eqs.pipelines.timing import PhaseTimes, phase_times
from eqs.pipelines.trainer import build_trainer, check_trainer, resumable
from eqs.processors import available_cores
from eqs.training import DetectionTask

log = logging.getLogger(__name__)


@explained
def train(cfg: DictConfig) -> RunResult | None:
    """Train and test as configured; a finished run is reported, an interrupted one gone on with.

    Returns:
        What the run measured; None where the training was only tried out, and from all processes
        but the first.
    """
    source = event_source(cfg.sim, cfg)
    protocol: LabelProtocol = instantiate(cfg.protocol)
    # Built for what they refuse, before a data set is generated.
    first = check_trainer(cfg)
    build_task(cfg, protocol, []).configure_optimizers()
    check_checkpoint(cfg)
    recipe(cfg)
    # What sees no real events does not depend on who recorded them.
    own = cfg if sees_real(source) else own_events(cfg)
    times = phase_times(own)
    data = prepare_data(own, times)
    protocol.require_known(data.classes)
    job = Job.of(own, source, data, protocol)
    if not first:  # a process that the first one started, which holds the lock and reports
        execute(job, times)
        return None
    with one_at_a_time(job.run.folder, f"training {job.run.folder}"):
        if job.run.finished and not cfg.overwrite:
            log.info("%s is finished already; overwrite=true trains it again", job.run.folder)
        elif not execute(job, times):
            return None
    run = job.run if own is cfg else tested_elsewhere(job.run, cfg)
    show(run)
    return run.result


def tested_elsewhere(run: Run, cfg: DictConfig) -> Run:
    """The run with its accuracy on the events of the chosen sensor, if another one is chosen."""
    other = other_sensor(cfg)
    if other is None:
        return run
    processes = torch.distributed.is_available() and torch.distributed.is_initialized()
    if processes:  # they would wait for each other
        log.info("type python evaluate.py sensor=NAME to test it on %s", other.words)
        return run
    with phase_times(cfg).measure(f"test on {other.name}", resumed=True):
        return on_other_sensor(run, other, dataset(cfg), cfg)


@dataclass(frozen=True, kw_only=True)
class Job:
    """One training: what is asked, of what data, and where it is kept.

    Args:
        cfg: the configuration.
        source: the events to train on.
        data: the data set.
        protocol: which boxes count.
        identity: what its checkpoints say of it.
        run: its folder.
        shorter: the training that it goes on from for longer, if it does.
        start: the detector trained here whose weights it starts from, if it does.
    """

    cfg: DictConfig
    source: EventSource
    data: Dataset
    protocol: LabelProtocol
    identity: Mapping[str, Any]
    run: Run
    shorter: Run | None
    start: Start | None

    @classmethod
    def of(
        cls, cfg: DictConfig, source: EventSource, data: Dataset, protocol: LabelProtocol
    ) -> Job:
        """The training of a configuration."""
        content, shorter = data_hash(data), shorter_config(cfg)
        return cls(
            cfg=cfg,
            source=source,
            data=data,
            protocol=protocol,
            identity=identity_of(cfg, source.label, content),
            run=run_of(cfg, source, content),
            shorter=None if shorter is None else run_of(shorter, source, content),
            start=start_of(cfg),
        )


def run_of(cfg: DictConfig, source: EventSource, data: str) -> Run:
    """The folder of a training, whose name covers every setting and what the data hold."""
    runs = Path(cfg.paths.runs) / cfg.data.name / source.label
    return Run(runs / f"{short_hash([recipe_hash(cfg), data])}-seed{cfg.seed}")


def execute(job: Job, times: PhaseTimes) -> bool:
    """Do the work of one run; says whether it left a result, as all but trials do."""
    cfg, run, source = job.cfg, job.run, job.source
    lightning.seed_everything(cfg.seed, workers=True, verbose=False)
    torch.set_num_threads(max(1, available_cores() // cfg.jobs))
    tests = streams_to_test(source)
    task = build_task(cfg, job.protocol, list(tests))
    checkpoint = checkpoint_path(cfg, run, job.shorter, job.identity, task.model)
    trainer = build_trainer(cfg, run, job.identity)
    prepare_stream(source, job.data, times)
    datamodule = instantiate(cfg.datamodule)(
        dataset=job.data, protocol=job.protocol, source=source, tests=tests
    )
    datamodule.prepare_data()
    if trainer.is_global_zero:  # only now: everything that can be refused was looked at
        if cfg.overwrite:
            run.put_aside()
        run.save_config(cfg, job.identity)
    name = trained_as(source, job.start)["simulator"]
    with times.measure(f"train {name}", resumed=checkpoint is not None):
        start = time.perf_counter()
        with resumable(run):
            trainer.fit(task, datamodule, ckpt_path=checkpoint)
            trainer.test(task, datamodule, verbose=False)
        seconds = time.perf_counter() - start
    tried = trials(cfg)
    if tried:
        log.warning("a trial, because of %s: it leaves no result", ", ".join(tried))
        for stream, accuracy in task.measured.items():
            log.info("%s: mAP %.1f of what was looked at", stream, 100 * accuracy.map)
        return False
    finish(job, trainer, task, seconds, times)
    return True


def finish(
    job: Job,
    trainer: lightning.Trainer,
    task: DetectionTask,
    seconds: float,
    times: PhaseTimes,
) -> None:
    """Keep the weights, the judge that they may be, and, last, what was measured."""
    trainer.save_checkpoint(job.run.weights, weights_only=True)
    if not trainer.is_global_zero:
        return
    if isinstance(job.source, RecordedEvents) and job.start is None:
        with times.measure("judge"):
            write_judge(job.cfg, job.run, job.data, trainer.strategy.root_device)
    real, card = task.measured["real"], job.protocol.card()
    job.run.finish(
        RunResult(
            **trained_as(job.source, job.start),
            caveat=job.source.caveat,
            setting=job.source.setting,
            seed=job.cfg.seed,
            sensor=sensor_label(job.cfg),
            recipe=recipe_hash(job.cfg),
            data=job.identity["data"],
            own=task.measured.get("own", real),  # a detector of real events has one test
            real=real,
            protocol={**card, "hash": short_hash(card)},
            seconds=round(seconds, 1),
        )
    )


def show(run: Run) -> None:
    """Print both mAPs of a run and its folder, which `model.weights` takes."""
    result, own, real = run.result, run.result.own, run.result.real
    seen_by = f" of {result.sensor}" * bool(result.sensor)
    Console().print(
        f"[bold]{result.system}[/bold] seed {result.seed}: "
        f"own test mAP {100 * own.map:.1f} (AP50 {100 * own.map_50:.1f}), "
        f"real test mAP{seen_by} {100 * real.map:.1f} (AP50 {100 * real.map_50:.1f})"
    )
    Console(soft_wrap=True).print(f"[bold]run[/bold]: {run.folder}")
