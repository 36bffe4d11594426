"""Progress for logs: a line an epoch, where several trainings share a terminal."""

from __future__ import annotations

import logging
import time

import lightning
from lightning.pytorch.callbacks import ProgressBar

log = logging.getLogger(__name__)


class EpochLines(ProgressBar):
    """Log loss, validation mAP and the time left at every epoch's end.

    Args:
        label: what is being trained.
    """

    def __init__(self, label: str) -> None:
        """Keep the label; the clock starts with the training."""
        super().__init__()
        self.label = label
        self._start = 0.0
        self._first_epoch = 0
        self._speaks = True

    def disable(self) -> None:
        """Be silent, as every process but the first is told to be."""
        self._speaks = False

    def enable(self) -> None:
        """Speak again."""
        self._speaks = True

    def on_train_start(self, trainer: lightning.Trainer, *_: object) -> None:
        """Start the clock, at the epoch from which the training goes on."""
        self._start, self._first_epoch = time.perf_counter(), trainer.current_epoch

    def on_train_epoch_end(self, trainer: lightning.Trainer, *_: object) -> None:
        """Log one line."""
        if not self._speaks:
            return
        done, last = trainer.current_epoch + 1, trainer.max_epochs or 0
        each = (time.perf_counter() - self._start) / (done - self._first_epoch)
        values = trainer.callback_metrics
        precision = f", val mAP {100 * values['val/map']:.1f}" if "val/map" in values else ""
        log.info(
            "%s: epoch %d of %d, loss %.2f%s, %.1f min left",
            self.label,
            done,
            last,
            values["loss"],
            precision,
            each * (last - done) / 60,
        )
