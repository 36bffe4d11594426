"""Training of a judge: a detector that learns from lessons of many kinds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import lightning
import torch
from lightning.pytorch.utilities.types import OptimizerLRScheduler
from torch import Tensor
from torch.optim.lr_scheduler import OneCycleLR
from torch.utils.data import DataLoader

from eqs.models import RVTDetector, gather_frames
from eqs.training.datamodule import StepSampler
from eqs.training.lesson_batches import LessonBatches, moved_to

BETAS = (0.9, 0.98)
WARMUP_SHARE = 0.1


class JudgeTask(lightning.LightningModule):
    """Trains a detector on batches that are cut, on its device, from lessons in memory.

    A batch depends on the number of its step alone, so a training that goes on from its last whole
    epoch goes on as if it had not been interrupted.

    Args:
        model: the detector.
        learnt: what it learns from.
        tested: what its loss is looked at on after every epoch; it chooses nothing.
        epochs: epochs of the whole training.
        learning_rate: its peak.
    """

    def __init__(
        self,
        model: RVTDetector,
        learnt: LessonBatches,
        tested: LessonBatches,
        *,
        epochs: int,
        learning_rate: float,
    ) -> None:
        """Keep the parts; lessons are no part of a checkpoint."""
        super().__init__()
        self.model, self.learnt, self.tested = model, learnt, tested
        self.epochs, self.learning_rate = epochs, learning_rate
        self.history: list[dict[str, float]] = []
        """By epoch the mean losses on what is learnt and on what is tested."""
        self._losses: list[Tensor] = []

    def setup(self, stage: str) -> None:
        """Bring the lessons to where the network computes."""
        self.learnt, self.tested = (
            replace(each, lessons=moved_to(each.lessons, self.device))
            for each in (self.learnt, self.tested)
        )

    def loss(self, batches: LessonBatches, step: int) -> Tensor:
        """The detector's loss on the batch of a step, each sample from a state of nothing."""
        histograms, labels, labelled = batches.batch(step)
        maps, _ = self.model.forward_sequence(histograms.float())
        frames = gather_frames(maps, labelled.to(self.device))
        found: Tensor = self.model.loss(frames, labels.to(self.device))["loss"]
        return found

    def training_step(self, step: Tensor, batch_idx: int) -> Tensor:
        """One step; the loader only counts."""
        found = self.loss(self.learnt, int(step))
        if not torch.isfinite(found):
            raise ValueError(
                f"Expected a finite loss, got {float(found)} at step {int(step)}; set "
                "recipe.learning_rate lower"
            )
        self._losses.append(found.detach())
        self.log("loss", found.detach(), prog_bar=True, logger=False)
        return found

    def on_train_epoch_end(self) -> None:
        """Note what the epoch was like."""
        steps = range(len(self.tested.canvases))
        with torch.no_grad(), self.trainer.precision_plugin.forward_context():
            held_out = [float(self.loss(self.tested, s)) for s in steps]
        losses = {
            "loss": float(torch.stack(self._losses).mean()),
            "held_out_loss": sum(held_out) / len(held_out),
        }
        self._losses.clear()
        self.history.append(losses)

    def train_dataloader(self) -> DataLoader[int]:
        """The numbers of the steps of an epoch."""
        per_epoch = self.learnt.steps_per_epoch
        numbers = list(range(self.epochs * per_epoch))
        # A resumed trainer takes its first batch before it names the epoch.
        done = self.trainer.fit_loop.total_batch_idx + 1
        sampler = StepSampler(per_epoch, epoch=done // per_epoch)
        return DataLoader(numbers, sampler=sampler, batch_size=None)  # type: ignore[arg-type]

    def configure_optimizers(self) -> OptimizerLRScheduler:
        """AdamW on one cycle."""
        parameters: Iterator[torch.nn.Parameter] = self.model.parameters()
        optimizer = torch.optim.AdamW(
            parameters, lr=self.learning_rate, betas=BETAS, weight_decay=0.0
        )
        schedule = OneCycleLR(
            optimizer,
            max_lr=self.learning_rate,
            total_steps=self.epochs * self.learnt.steps_per_epoch,
            pct_start=WARMUP_SHARE,
            div_factor=20,
            final_div_factor=500,
            cycle_momentum=False,
        )
        return {
            "optimizer": optimizer,
            "lr_scheduler": {"scheduler": schedule, "interval": "step"},
        }

    def on_save_checkpoint(self, checkpoint: dict[str, object]) -> None:
        """Keep what the epochs were like."""
        checkpoint["history"] = self.history

    def on_load_checkpoint(self, checkpoint: dict[str, object]) -> None:
        """Take it back."""
        self.history = list(checkpoint["history"])  # type: ignore[call-overload]
