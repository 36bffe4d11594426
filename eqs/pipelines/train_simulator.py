"""Learn the networks of a simulator from the events of a sensor."""

from __future__ import annotations

import logging
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lightning
import torch
from hydra.utils import instantiate
from lightning.pytorch.callbacks import ModelCheckpoint
from omegaconf import DictConfig
from torch.utils.data import DataLoader

from eqs.data import Dataset, Recording
from eqs.files import one_at_a_time, read_json, write_json
from eqs.pipelines.command import explained, quiet_libraries
from eqs.pipelines.recipe import data_hash
from eqs.processors import available_cores, side_by_side
from eqs.simulators.learned import FOLDS, EventGAN, Learning
from eqs.training import CompleteCheckpoints
from eqs.training.frame_pairs import BatchNumbers, FramePairs, simplest
from eqs.training.progress import EpochLines
from eqs.training.volume_task import VolumeTask

log = logging.getLogger(__name__)
STARTED = "started.json"
VALIDATIONS = 5  # in a training; they choose nothing


@explained
def train_simulator(cfg: DictConfig) -> None:
    """Learn the networks of the configured simulator, or say that they are there.

    Raises:
        ValueError: the simulator does not learn.
    """
    simulator = instantiate(cfg.sim)
    if not isinstance(simulator, EventGAN):
        raise ValueError(
            f"Expected a simulator that learns, got {cfg.sim.get('_target_')}; set sim=eventgan"
        )
    learning = simulator.network
    learn(learning)
    for fold, found in enumerate(learning.record()["val"]):
        log.info(
            "network %d: negative log-likelihood %.4f on val (%.4f by one rate, %.4f by one a "
            "pixel), %.2f events per event, cosine %.3f",
            fold, found["nll"], found["nll_constant"], found["nll_per_pixel"],
            found["events_per_real_event"], found["cosine"],
        )  # fmt: skip
    log.info("%s", learning.folder)


def ensure_learned(simulator: object) -> None:
    """Learn what a simulator lacks; nothing for those that do not learn."""
    if isinstance(simulator, EventGAN):
        learn(simulator.network)


def learn(learning: Learning) -> None:
    """Learn all networks, side by side; those that are there are kept, others gone on with."""
    teacher = teacher_of(learning)
    teacher.prepare()
    with one_at_a_time(learning.folder, f"learning {learning.folder.name}"):
        started = {"data": data_hash(teacher), "teacher": teacher.name}
        if learning.finished and learning.record().items() >= started.items():
            return
        note = learning.folder / STARTED
        if not note.is_file() or read_json(note) != started:  # of other recordings
            for old in learning.folder.glob("*"):
                shutil.rmtree(old) if old.is_dir() else old.unlink()
            write_json(note, started)
        log.info("learning %s, once: about ten minutes on two cores", learning.folder.name)
        jobs = [Fold(learning, fold) for fold in range(FOLDS)]
        done = dict(side_by_side(learn_fold, jobs, min(FOLDS, available_cores())))
        learning.finish(
            {
                **started,
                "sensor": teacher.sensor_hash,
                "recipe": learning.recipe(),
                "folds": [[each.name for each in job.recordings(teacher)] for job in jobs],
                "val": [done[job.number] for job in jobs],
            }
        )


def teacher_of(learning: Learning) -> Dataset:
    """The data set whose events are learned.

    Raises:
        ValueError: it is none.
    """
    teacher = learning.taught_by
    if not isinstance(teacher, Dataset):
        raise ValueError(
            f"Expected a data set to learn events from, got a {type(teacher).__name__}; set "
            "sim.network.teacher"
        )
    return teacher


@dataclass(frozen=True)
class Fold:
    """One network: every other recording, from this one on, is what it learns from."""

    learning: Learning
    number: int

    def recordings(self, teacher: Dataset) -> list[Recording]:
        """What it learns from."""
        return teacher.recordings("train")[self.number :: FOLDS]

    @property
    def folder(self) -> Path:
        """Its checkpoints."""
        return self.learning.folder / f"fold{self.number}"


def learn_fold(job: Fold) -> tuple[int, dict[str, float]]:
    """Train one network on one core, from its last whole epoch on if it was interrupted.

    One core, so that its sums and with them its weights are the same on any number of cores.
    """
    torch.set_num_threads(1)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    quiet_libraries()
    done = job.folder / "done.json"
    if not (done.is_file() and job.learning.weights(job.number).is_file()):
        task = VolumeTask(job.learning, job.number)
        trainer = trainer_of(job)
        train, val = loaders(job)
        last = job.folder / "last.ckpt"
        trainer.fit(
            task, train, val, ckpt_path=last if last.is_file() else None, weights_only=False
        )
        job.learning.keep(job.number, task.generator.state_dict())
        learned = FramePairs(job.recordings(teacher_of(job.learning)), augmented=False)
        write_json(done, {**task.found, **simplest(learned, val.dataset)})  # type: ignore[arg-type]
    return job.number, read_json(done)


def trainer_of(job: Fold) -> lightning.Trainer:
    """A trainer on one core that keeps its last whole epoch."""
    last = ModelCheckpoint(
        job.folder, filename="last", save_on_train_epoch_end=True, enable_version_counter=False
    )
    epochs = job.learning.epochs
    return lightning.Trainer(
        accelerator="cpu",
        devices=1,
        max_epochs=epochs,
        check_val_every_n_epoch=max(1, epochs // VALIDATIONS),
        callbacks=[last, EpochLines(label=f"eventgan network {job.number}")],
        plugins=[CompleteCheckpoints()],
        logger=False,
        num_sanity_val_steps=0,
        enable_model_summary=False,
    )


def loaders(job: Fold) -> tuple[DataLoader[Any], DataLoader[Any]]:
    """Batches of augmented pairs to learn from, and plain pairs of the val split."""
    learning, teacher = job.learning, teacher_of(job.learning)
    pairs = FramePairs(job.recordings(teacher), augmented=True, seed=learning.seed)
    numbers = BatchNumbers(len(pairs), learning.steps_per_epoch, learning.batch_size, learning.seed)
    train = DataLoader(pairs, batch_sampler=numbers)
    val = FramePairs(teacher.recordings("val"), augmented=False)
    return train, DataLoader(val, batch_size=learning.batch_size)
