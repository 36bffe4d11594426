"""Recurrent detector training: chunks of windows, carried states, mAP on every test stream."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import isfinite
from typing import Any, cast

import lightning
import torch
from lightning.pytorch.utilities.types import OptimizerLRScheduler
from torch import Tensor, nn
from torch.optim import Optimizer
from torch.optim.lr_scheduler import LRScheduler

from eqs.data import LabelProtocol
from eqs.metrics import Accuracy, MeanAveragePrecision
from eqs.models import Detections, Detector, detach_states, gather_frames, reset_states
from eqs.models.checkpoint import GEOMETRY, RECORD
from eqs.models.protocol import (
    check_features,
    check_losses,
    check_predictions,
    require_detector,
)
from eqs.models.states import Carried, move_states, of_all_processes, of_this_process
from eqs.models.synchronised import mean_over_processes
from eqs.training.checkpoints import require_finite
from eqs.training.datasets import Batch
from eqs.training.selection import Selection

PROGRESS = ("last_epoch", "_step_count", "_last_lr")  # of a schedule; the rest are its constants


class DetectionTask(lightning.LightningModule):
    """Train and evaluate a detector on batches of consecutive windows.

    Convention: states flow from a batch to the next one of the same slot and are cut from the
    gradient in between; rows marked `first` start from zero.

    Args:
        model: the detector, a module with what `Detector` asks.
        optimizer: builds the optimizer from the parameters.
        scheduler: builds the schedule, stepped once per batch, from the optimizer.
        protocol: the classes, and which detections enter a mAP with which score.
        test_streams: name of each test dataloader's event stream.
        confidence_threshold: objectness times class probability below which a box is dropped.
        nms_threshold: overlap above which the weaker of two boxes of a class is dropped.
        record: what checkpoints say of the detector beside its classes and the size of its input,
            as `load_detector` reads it.

    Raises:
        ValueError: the model lacks a method of a detector.
    """

    def __init__(
        self,
        model: nn.Module,
        optimizer: Callable[[Iterable[nn.Parameter]], Optimizer],
        scheduler: Callable[[Optimizer], LRScheduler],
        protocol: LabelProtocol,
        test_streams: Sequence[str] = (),
        confidence_threshold: float = 0.001,
        nms_threshold: float = 0.45,
        record: Mapping[str, Any] | None = None,
    ) -> None:
        """Keep the parts and prepare one mAP for each stream."""
        super().__init__()
        require_detector(model)
        self.model = model
        self.make_optimizer = optimizer
        self.make_scheduler = scheduler
        self.selection = Selection(protocol, confidence_threshold, nms_threshold)
        self.protocol = protocol
        self.test_streams = list(test_streams)
        classes = len(protocol.class_names)
        self.val_precision = MeanAveragePrecision(num_classes=classes)
        self.test_precision = [MeanAveragePrecision(num_classes=classes) for _ in test_streams]
        self.test_metrics = nn.ModuleList(self.test_precision)  # so that they move with the task
        self.measured: dict[str, Accuracy] = {}
        """What the last validation or test found, by the name of the stream, `val` among them."""
        self.record = dict(record or {})
        self._train_states: Carried = None
        self._evaluation_states: Carried = None

    @property
    def detector(self) -> Detector:
        """The model as what a training asks of it."""
        return cast(Detector, self.model)

    def _run(self, batch: Batch, states: Carried) -> tuple[Sequence[Tensor], Carried]:
        """Features of a chunk's windows, and the states after it."""
        histograms = batch["histograms"].float()
        again = reset_states(states, batch["first"])
        maps, states = self.detector.forward_sequence(histograms, again)
        check_features(maps, *histograms.shape[:2])
        self.record |= dict(zip(("height", "width"), histograms.shape[-2:], strict=True))
        return maps, states

    def training_step(self, batch: Batch, batch_idx: int) -> Tensor:
        """Loss over all labelled frames of the chunk, in one call of neck and head."""
        maps, states = self._run(batch, self._train_states)
        self._train_states = detach_states(states)
        labelled = batch["labelled"]
        losses = self.detector.loss(gather_frames(maps, labelled), batch["labels"][labelled])
        check_losses(losses)
        self._require_finite(losses)
        self.log_dict({f"train/{name}": value.detach() for name, value in losses.items()})
        self.log("loss", losses["loss"].detach(), prog_bar=True, logger=False)
        return losses["loss"]

    def _require_finite(self, losses: dict[str, Tensor]) -> None:
        """Stop all processes where one of them has nothing to learn from."""
        finite = torch.isfinite(losses["loss"].detach())
        if mean_over_processes(finite.float()) == 1:
            return
        terms = {name: float(value.detach()) for name, value in losses.items()}
        broken = [f"{name} = {value}" for name, value in terms.items() if not isfinite(value)]
        rate = self.trainer.optimizers[0].param_groups[0]["lr"]
        raise ValueError(
            f"Expected a finite loss, got {', '.join(broken) or 'another process without one'} at "
            f"step {self.trainer.global_step} with a learning rate of {rate:.3g} (last.ckpt is as "
            "it was); set recipe.learning_rate lower or trainer.precision=32-true"
        )

    def on_validation_epoch_start(self) -> None:
        """Forget what an interrupted evaluation left."""
        self._begin(self.val_precision)

    def validation_step(self, batch: Batch, batch_idx: int) -> None:
        """Collect detections on the stream the detector was trained on."""
        self._evaluate(batch, self.val_precision)

    def on_validation_epoch_end(self) -> None:
        """Log the mAP of the whole validation set."""
        self._finish("val", "val", self.val_precision)

    def on_test_epoch_start(self) -> None:
        """Forget what an interrupted evaluation left."""
        self._begin(*self.test_precision)

    def test_step(self, batch: Batch, batch_idx: int, dataloader_idx: int = 0) -> None:
        """Collect detections on one of the test streams."""
        self._evaluate(batch, self.test_precision[dataloader_idx])

    def on_test_epoch_end(self) -> None:
        """Log the mAP of each test stream."""
        for stream, metric in zip(self.test_streams, self.test_precision, strict=True):
            self._finish(stream, f"test/{stream}", metric)

    def detect(self, batch: Batch) -> list[Detections]:
        """Detections of each labelled frame of a chunk, with states carried from the last call.

        Returns:
            One dict per labelled frame with boxes (n, 4) as x1 y1 x2 y2 pixels, scores, labels.
        """
        maps, self._evaluation_states = self._run(batch, self._evaluation_states)
        labelled = batch["labelled"]
        if not labelled.any():
            return []
        predictions = self.detector.detect(gather_frames(maps, labelled))
        check_predictions(predictions, int(labelled.sum()), len(self.protocol.class_names))
        return self.selection(predictions, batch["histograms"].shape[-1])

    def _begin(self, *metrics: MeanAveragePrecision) -> None:
        self._evaluation_states = None
        for metric in metrics:
            metric.reset()

    def _evaluate(self, batch: Batch, metric: MeanAveragePrecision) -> None:
        detections = self.detect(batch)
        targets = [ground_truth(rows) for rows in batch["labels"][batch["labelled"]]]
        if detections:
            metric.update(detections, targets)

    def _finish(self, stream: str, prefix: str, metric: MeanAveragePrecision) -> None:
        accuracy = Accuracy.of(metric.compute(), self.protocol.class_names)
        metric.reset()
        self._evaluation_states = None
        self.measured[stream] = accuracy
        self.log_dict({f"{prefix}/{name}": value for name, value in accuracy.scalars().items()})

    def configure_optimizers(self) -> OptimizerLRScheduler:
        """Optimizer with a schedule that moves once per batch.

        Raises:
            ValueError: one of their settings is of the wrong kind or out of range.
        """
        try:
            optimizer = self.make_optimizer(self.model.parameters())
            scheduler = self.make_scheduler(optimizer)
        except (TypeError, ValueError) as error:
            raise ValueError(
                f"Expected settings that optimizer and schedule take, got: {error}; set "
                "recipe.learning_rate, or what is wrong below task.optimizer and task.scheduler"
            ) from error
        return {
            "optimizer": optimizer,
            "lr_scheduler": {"scheduler": scheduler, "interval": "step"},
        }

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Keep the recurrent states of every process, so that a run goes on where it stopped.

        Raises:
            ValueError: a weight is not finite.
        """
        require_finite(checkpoint["state_dict"], checkpoint["global_step"])
        classes = list(self.protocol.class_names)
        checkpoint[RECORD] = {**self.record, "class_names": classes}
        if hasattr(self.model, GEOMETRY):  # for whoever reads the weights alone
            checkpoint[GEOMETRY] = getattr(self.model, GEOMETRY)
        checkpoint["train_states"] = of_all_processes(self._train_states)

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Take the recurrent states of this process back.

        Convention: the schedule is the configured one, taken up at the step of the checkpoint. So
        a training that goes on for longer than it was begun for follows the longer schedule from
        that step on.
        """
        states = of_this_process(checkpoint.get("train_states"))
        self._train_states = move_states(states, self.device) if states is not None else None
        if checkpoint.get("lr_schedulers"):
            configured = self.make_scheduler(self.make_optimizer(self.model.parameters()))
            constants = configured.state_dict().items()
            for schedule in checkpoint["lr_schedulers"]:
                schedule |= {name: value for name, value in constants if name not in PROGRESS}


def ground_truth(rows: Tensor) -> dict[str, Tensor]:
    """Boxes of one frame from label rows (class, cx, cy, w, h) with zero rows as padding."""
    rows = rows[rows[:, 3] > 0].float()
    centre, half = rows[:, 1:3], rows[:, 3:5] / 2
    return {"boxes": torch.cat([centre - half, centre + half], dim=1), "labels": rows[:, 0].long()}
