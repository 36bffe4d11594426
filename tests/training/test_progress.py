"""Lines of progress: one an epoch, from the first process alone."""

import logging
from types import SimpleNamespace

import torch

from eqs.training import EpochLines

TRAINER = SimpleNamespace(
    current_epoch=0, max_epochs=2, callback_metrics={"loss": torch.tensor(1.5)}
)


def test_every_process_but_the_first_is_silent(caplog):
    caplog.set_level(logging.INFO)
    lines = EpochLines("esim")
    lines.on_train_start(TRAINER)
    lines.disable()
    lines.on_train_epoch_end(TRAINER)
    assert not caplog.messages
    lines.enable()
    lines.on_train_epoch_end(TRAINER)
    assert "esim: epoch 1 of 2, loss 1.50" in caplog.text
