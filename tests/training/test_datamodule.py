"""Loaders: each phase reads its own events, and epochs go on where they stopped."""

import shutil
import subprocess
import sys
from pathlib import Path

import lightning
import pytest
import torch
from lightning.pytorch.callbacks import ModelCheckpoint
from torch import nn

from eqs.data import DSECFolder, LabelProtocol, RecordedEvents
from eqs.events import EventReader
from eqs.training import Augmentation, EventDataModule, StepSampler

PROTOCOL = LabelProtocol(name="test", classes={"car": [2]})


class EarlierEvents:
    """Another stream of the same recordings: every event a little earlier."""

    def __init__(self, folder):
        self.folder = folder

    def path(self, recording) -> Path:
        path = self.folder / f"{recording.name}.h5"
        with EventReader(recording.events_path) as reader:
            reader.read().shifted(-5_000).save(path)
        return path


@pytest.fixture
def dataset(tmp_path, make_recording):
    for index, name in enumerate(("train_a", "train_b", "val_a", "test_a", "test_b")):
        make_recording(tmp_path / "data" / name, frames=5 + index, seed=index)
    splits = {split: [f"{split}_*"] for split in ("train", "val", "test")}
    return DSECFolder(name="tiny", root=tmp_path / "data", size="32x24", splits=splits)


@pytest.fixture
def module(dataset, tmp_path):
    def build(**options):
        settings = {
            "batch_size": 2,
            "sequence_length": 2,
            "steps_per_epoch": 3,
            "epochs": 4,
            "bins": 2,
            "evaluation_length": 4,
            "augmentation": Augmentation(),
            **options,
        }
        (tmp_path / "own").mkdir(exist_ok=True)
        own = EarlierEvents(tmp_path / "own")
        tests = {"own": own, "real": RecordedEvents()}
        return EventDataModule(dataset, PROTOCOL, own, tests, **settings)

    return build


def test_processes_that_simulate_need_no_torch():
    code = "import sys, eqs.data; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def collected(loader):
    return [batch["histograms"].clone() for batch in loader]


def test_epochs_are_stretches_of_steps():
    sampler = StepSampler(4)
    assert list(sampler) == [0, 1, 2, 3]
    sampler.set_epoch(2)
    assert list(sampler) == [8, 9, 10, 11]
    assert len(sampler) == 4


def test_workers_do_not_change_batches(module):
    alone, helped = (collected(module(num_workers=n).train_dataloader()) for n in (0, 2))
    assert len(alone) == 3
    assert all(torch.equal(a, b) for a, b in zip(alone, helped, strict=True))


def test_streams_of_the_tests_differ_only_in_events(module):
    own, real = module().test_dataloader()
    for a, b in zip(own, real, strict=True):
        assert torch.equal(a["labels"], b["labels"])
        assert torch.equal(a["times_us"], b["times_us"])
        assert not torch.equal(a["histograms"], b["histograms"])


def test_validation_uses_the_training_events(module, dataset):
    batch = next(iter(module().val_dataloader()))
    own = module().evaluation_dataset("val", module().source)[0]
    assert torch.equal(batch["histograms"], own["histograms"])
    assert sum(len(each["times_us"]) for each in module().val_dataloader()) == 6


def test_processes_share_the_recordings(module):
    shares = [
        module().evaluation_dataset("test", RecordedEvents(), rank, 2).sources for rank in (0, 1)
    ]
    names = [[source.recording.name for source in share] for share in shares]
    assert names == [["test_a"], ["test_b"]]


def test_no_process_may_be_left_without_a_recording(module):
    with pytest.raises(ValueError, match=r"for each of 3 processes, got 2; set trainer\.devices"):
        module().evaluation_dataset("test", RecordedEvents(), 0, 3)


class Recorder(lightning.LightningModule):
    """Notes the content of every training batch, and may be interrupted."""

    def __init__(self, interrupted_at):
        super().__init__()
        self.weight = nn.Parameter(torch.zeros(()))
        self.seen = []
        self.interrupted_at = interrupted_at

    def training_step(self, batch, batch_idx):
        if len(self.seen) == self.interrupted_at:
            raise RuntimeError("interrupted")
        self.seen.append(int(batch["histograms"].long().sum()) + int(batch["labels"].sum()))
        return self.weight**2

    def validation_step(self, batch, batch_idx):
        assert batch["histograms"].shape[1] == 1

    def configure_optimizers(self):
        return torch.optim.SGD(self.parameters(), lr=0.1)


def fit(module, folder, *, resume=False, interrupted_at=None, **checkpoint):
    recorder = Recorder(interrupted_at)
    trainer = lightning.Trainer(
        accelerator="cpu",
        max_epochs=4,
        logger=False,
        callbacks=[ModelCheckpoint(folder, filename="last", **checkpoint)],
        enable_progress_bar=False,
        enable_model_summary=False,
        num_sanity_val_steps=0,
        use_distributed_sampler=False,
        default_root_dir=folder,
    )
    trainer.fit(recorder, module(), ckpt_path=folder / "last.ckpt" if resume else None)
    return recorder.seen


@pytest.mark.filterwarnings("ignore:.*does not have many workers", "ignore:.*log_every_n_steps")
@pytest.mark.filterwarnings("ignore:.*LeafSpec.*:FutureWarning")
@pytest.mark.filterwarnings("ignore:Checkpoint directory .* exists and is not empty")
@pytest.mark.parametrize("at_train_end", [True, False])
def test_resumed_training_sees_the_batches_that_were_left(module, tmp_path, at_train_end):
    whole = fit(module, tmp_path / "whole")
    assert len(whole) == 12
    assert len(set(whole)) > 8
    options = {"save_on_train_epoch_end": at_train_end, "enable_version_counter": False}
    with pytest.raises(RuntimeError, match="interrupted"):
        fit(module, tmp_path / "part", interrupted_at=8, **options)
    assert fit(module, tmp_path / "part", resume=True, **options) == whole[6:]


@pytest.mark.parametrize(
    ("choice", "key"),
    [
        ({"epochs": 0}, "recipe.epochs"),
        ({"steps_per_epoch": "ten"}, "recipe.steps_per_epoch"),
        ({"batch_size": None}, "recipe.batch_size"),
        ({"window_us": 0}, "datamodule.window_us"),
        ({"num_workers": -1}, "datamodule.num_workers"),
        ({"seed": -1}, "seed"),
    ],
)
def test_impossible_numbers_are_refused_by_their_keys(module, choice, key):
    with pytest.raises(ValueError, match=rf"Expected {key} to be a whole number .*; set {key}$"):
        module(**choice)


def test_faults_of_any_recording_are_found_before_the_first_step(module, dataset):
    module().prepare_data()
    path = dataset.root / "test_b" / "events/left/events.h5"
    whole = path.read_bytes()
    path.write_bytes(whole[:3000])
    with pytest.raises(ValueError, match=r"test_b/.*events\.h5 to be a whole HDF5 file"):
        module().prepare_data()
    path.write_bytes(whole)
    with EventReader(path) as reader:
        later = reader.read().shifted(10_000_000)
    later.save(path)
    with pytest.raises(ValueError, match=r"one clock in .*test_b.* got events from 10995"):
        module().prepare_data()


def test_nothing_to_find_is_no_test(module, dataset):
    for name in ("test_a", "test_b"):
        shutil.rmtree(dataset.root / name / "object_detections")
    with pytest.raises(ValueError, match=r"labelled boxes to test on, got none .* test_a, test_b"):
        module().prepare_data()
