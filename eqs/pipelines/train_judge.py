"""Train a judge on rendered lessons and keep what scores need of it."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path
from typing import Any

import lightning
import torch
from hydra.utils import instantiate
from lightning.pytorch.callbacks import ModelCheckpoint
from omegaconf import DictConfig, OmegaConf

from eqs.files import one_at_a_time, short_hash, write_json
from eqs.metrics import Judge
from eqs.models import RVTDetector
from eqs.pipelines.command import explained
from eqs.training import CompleteCheckpoints
from eqs.training.judge_task import JudgeTask
from eqs.training.lesson_batches import Canvas, LessonBatches, LessonTensors
from eqs.training.progress import EpochLines

log = logging.getLogger(__name__)
LOG = "training.json"


@explained
def train_judge(cfg: DictConfig) -> None:
    """Render the lessons, train on them and write the judge, in half precision, to `cfg.out`.

    Raises:
        ValueError: a setting makes no sense, or the training diverges.
    """
    folder = Path(cfg.paths.runs) / f"judge-{short_hash([*settings(cfg).values()])}"
    with one_at_a_time(folder, f"training {folder}"):
        task = build_task(cfg)
        trainer = trainer_of(cfg, folder)
        last = folder / "last.ckpt"
        trainer.fit(task, ckpt_path=last if last.is_file() else None, weights_only=False)
    keep(cfg, task, Path(cfg.out))
    log.info("%s", cfg.out)


def build_task(cfg: DictConfig) -> JudgeTask:
    """The training, with its lessons in memory."""
    lessons = instantiate(cfg.lessons)
    folder = lessons.prepare(Path(cfg.paths.datasets))
    tensors = [
        LessonTensors.of(*lessons.load(folder, number))
        for number in range(lessons.count + lessons.held_out)
    ]
    recipe = cfg.recipe
    canvases = [
        Canvas(height=height, width=width, samples=samples)
        for height, width, samples in recipe.canvases
    ]
    learnt = LessonBatches(
        tensors[: lessons.count],
        canvases,
        steps_per_epoch=recipe.steps_per_epoch,
        windows=recipe.windows,
        labelled=recipe.labelled,
        seed=cfg.seed,
    )
    tested = replace(learnt, lessons=tensors[lessons.count :], steps_per_epoch=1)
    lightning.seed_everything(cfg.seed, verbose=False)
    model: RVTDetector = instantiate(cfg.model)
    return JudgeTask(
        model, learnt, tested, epochs=recipe.epochs, learning_rate=recipe.learning_rate
    )


def trainer_of(cfg: DictConfig, folder: Path) -> lightning.Trainer:
    """The configured trainer, which keeps its last whole epoch."""
    last = ModelCheckpoint(
        folder, filename="last", save_on_train_epoch_end=True, enable_version_counter=False
    )
    trainer: lightning.Trainer = instantiate(
        cfg.trainer,
        callbacks=[last, EpochLines(label="judge")],
        plugins=[CompleteCheckpoints()],
        logger=False,
    )
    return trainer


def keep(cfg: DictConfig, task: JudgeTask, out: Path) -> None:
    """Write the judge, what it was trained by and what its epochs were like."""
    judge = Judge.shortened(task.model.backbone, cfg.description)
    judge.save(out)
    write_json(
        out / LOG,
        {
            "command": "eqs train-judge",
            "settings": settings(cfg),
            "lessons": instantiate(cfg.lessons).definition_hash(),
            "device": device_name(task),
            "epochs": task.history,
        },
    )


def settings(cfg: DictConfig) -> dict[str, Any]:
    """Every setting on which the weights depend, beside the device."""
    plain = OmegaConf.to_container(cfg, resolve=True)
    return {name: dict(plain)[name] for name in ("seed", "lessons", "recipe", "model")}  # type: ignore[arg-type]


def device_name(task: JudgeTask) -> str:
    """What it was trained on."""
    device = task.trainer.strategy.root_device
    return torch.cuda.get_device_name(device) if device.type == "cuda" else "processor"
