"""What a detector finds, drawn into the logger while it trains."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from typing import cast

import lightning
import numpy as np
import torch
from lightning.pytorch.callbacks import Callback
from lightning.pytorch.loggers import TensorBoardLogger

from eqs.drawing import histogram_picture, with_boxes
from eqs.training.datasets import Batch
from eqs.training.selection import boxes_of
from eqs.training.task import DetectionTask

CHOICE = 60  # frames to choose from; a whole recording may not fit into memory


class DetectionPictures(Callback):
    """After each validation, log a few frames of its first recording with what was found there.

    Args:
        pictures: how many, evenly spaced.
        min_score: smallest confidence drawn.
        zoom: side of the square that a pixel becomes.
    """

    def __init__(self, pictures: int = 4, min_score: float = 0.3, zoom: int = 3) -> None:
        """Keep the settings."""
        self.pictures, self.min_score, self.zoom = pictures, min_score, zoom

    @torch.no_grad()
    def on_validation_epoch_end(
        self, trainer: lightning.Trainer, pl_module: lightning.LightningModule
    ) -> None:
        """Draw and log, where a TensorBoard logger listens."""
        boards = [each for each in trainer.loggers if isinstance(each, TensorBoardLogger)]
        if not boards or not isinstance(pl_module, DetectionTask) or not trainer.is_global_zero:
            return
        loader = cast(Iterable[Batch], trainer.val_dataloaders)
        drawn = np.stack(list(islice(self._drawn(pl_module, loader), CHOICE)))
        chosen = np.linspace(0, len(drawn) - 1, min(self.pictures, len(drawn))).round().astype(int)
        large = drawn[chosen].repeat(self.zoom, axis=1).repeat(self.zoom, axis=2)
        for board in boards:
            board.experiment.add_images(
                "val/detections", large, trainer.global_step, dataformats="NHWC"
            )

    def _drawn(self, task: DetectionTask, loader: Iterable[Batch]) -> Iterator[np.ndarray]:
        """Pictures of the labelled frames of the first recording."""
        for number, batch in enumerate(loader):
            if number and batch["first"].any():
                return
            batch = {name: value.to(task.device) for name, value in batch.items()}
            histograms = batch["histograms"][batch["labelled"]]
            for histogram, found in zip(histograms, task.detect(batch), strict=True):
                yield with_boxes(
                    histogram_picture(histogram.cpu().numpy()),
                    boxes_of(found),
                    min_score=self.min_score,
                )
