"""Pictures of detections in the logger."""

from functools import partial
from types import SimpleNamespace

import pytest
import torch
from lightning.pytorch.loggers import CSVLogger, TensorBoardLogger
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from torch.optim import SGD
from torch.optim.lr_scheduler import ConstantLR

from eqs.data import LabelProtocol
from eqs.models import RVTDetector
from eqs.training import DetectionPictures, DetectionTask


def chunks(recordings=2, windows=3, height=32, width=64):
    generator = torch.Generator().manual_seed(0)
    for _ in range(recordings):
        for chunk in range(2):
            yield {
                "histograms": torch.randint(
                    0, 3, (windows, 1, 20, height, width), generator=generator, dtype=torch.uint8
                ),
                "labelled": torch.ones(windows, 1, dtype=torch.bool),
                "labels": torch.zeros(windows, 1, 2, 5),
                "first": torch.tensor([chunk == 0]),
            }


def test_frames_of_the_first_recording_are_logged(tmp_path):
    torch.manual_seed(0)
    protocol = LabelProtocol(name="two", classes={"car": [2], "pedestrian": [0]})
    model = RVTDetector("tiny", num_classes=2, partition_split_32=1)
    task = DetectionTask(model, partial(SGD, lr=0.1), partial(ConstantLR), protocol).eval()
    board = TensorBoardLogger(tmp_path, name="", version="board")
    trainer = SimpleNamespace(
        loggers=[CSVLogger(tmp_path), board],
        is_global_zero=True,
        val_dataloaders=list(chunks()),
        global_step=7,
    )
    DetectionPictures(pictures=4, min_score=0.0, zoom=2).on_validation_epoch_end(trainer, task)
    board.experiment.flush()
    record = EventAccumulator(str(tmp_path / "board"), size_guidance={"images": 0})
    record.Reload()
    (logged,) = record.Images("val/detections")
    assert (logged.step, logged.height, logged.width) == (7, 64, 4 * 128)
    board.experiment.close()


@pytest.mark.parametrize("first", [True, False])
def test_without_a_board_nothing_is_drawn(tmp_path, monkeypatch, first):
    def fail(*_):
        raise AssertionError("drawn")

    monkeypatch.setattr(DetectionPictures, "_drawn", fail)
    board = TensorBoardLogger(tmp_path)
    loggers = [CSVLogger(tmp_path)] if first else [board]  # no board, or not the first process
    trainer = SimpleNamespace(loggers=loggers, is_global_zero=first)
    DetectionPictures().on_validation_epoch_end(trainer, SimpleNamespace())
    assert not list(tmp_path.rglob("events.*"))
