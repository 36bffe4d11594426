"""Trainings that are cut, tried out, done anew or gone on with for longer, and what names them."""

import logging
from pathlib import Path

import numpy as np
import pytest
import torch
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate
from lightning.pytorch.callbacks import Callback
from omegaconf import DictConfig, open_dict
from PIL import Image

import eqs
from eqs.pipelines.build import dataset, event_source
from eqs.pipelines.recipe import recipe_hash
from eqs.pipelines.resolvers import register_resolvers
from eqs.pipelines.resume import shorter_ones
from eqs.pipelines.runs import finished_runs
from eqs.pipelines.train import Job, train

CONFIGS = Path(eqs.__file__).parent / "configs"


class Cut(Callback):
    """Ctrl-C in the second epoch."""

    def on_train_batch_end(self, trainer, *_):
        if trainer.global_step == trainer.num_training_batches + 1:
            raise KeyboardInterrupt


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("resuming")


def configured(place: Path, *overrides: str) -> DictConfig:
    register_resolvers()
    paths = [f"paths.{key}={place / key}" for key in ("datasets", "simulated", "runs", "results")]
    small = [
        "experiment=smoke",
        "data.size=32x32",
        "data.generator.frames=5",
        "data.generator.sequences={train: 1, val: 1, test: 1}",
        "+data.generator.workers=1",
        "recipe.steps_per_epoch=1",
        "recipe.sequence_length=2",
        "protocol.min_side_px=0",
        "protocol.min_diagonal_px=0",
        "task.confidence_threshold=0.5",
        "logger=csv",
    ]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose("train", overrides=[*small, *paths, *overrides])
    with open_dict(cfg):
        cfg.callbacks = {}
    return cfg


def job(cfg: DictConfig) -> Job:
    return Job.of(cfg, event_source(cfg.sim, cfg), dataset(cfg), instantiate(cfg.protocol))


def weights(cfg: DictConfig) -> dict[str, torch.Tensor]:
    return torch.load(job(cfg).run.weights, weights_only=True)["state_dict"]


def assert_equal_weights(one: DictConfig, other: DictConfig) -> None:
    for first, second in zip(weights(one).values(), weights(other).values(), strict=True):
        assert torch.equal(first, second)


@pytest.fixture(scope="module")
def real(place: Path) -> DictConfig:
    cfg = configured(place, "sim=real")
    assert train(cfg) is not None
    return cfg


@pytest.mark.slow
def test_the_same_command_goes_on_after_ctrl_c_and_ends_the_same(
    place: Path, real: DictConfig, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    # Looking before it learns, as others do, changes nothing.
    again = configured(
        place, "sim=real", f"paths.runs={tmp_path}", "trainer.num_sanity_val_steps=2"
    )
    cut = again.copy()
    with open_dict(cut):
        cut.callbacks = {"progress": {"_target_": f"{__name__}.Cut"}}
    with pytest.raises(SystemExit) as stopped:
        train(cut)
    assert stopped.value.code == 130
    last = job(again).run.last_checkpoint
    assert f"is kept in {last}; type the same command again to go on" in caplog.messages[-1]
    with caplog.at_level(logging.INFO):
        train(again)
    assert f"going on from {last}" in caplog.text
    assert_equal_weights(again, real)


@pytest.mark.parametrize(
    "wrong",
    ["trainer=gpu", "logger=wandb", "ckpt_path=nowhere.ckpt", "model.weights=nowhere.ckpt",
     "recipe.learning_rate=abc", "model.size=huge"],
)  # fmt: skip
def test_what_can_be_refused_is_refused_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, wrong: str
) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    monkeypatch.setattr("lightning.pytorch.loggers.wandb._WANDB_AVAILABLE", False)
    cfg = configured(tmp_path, "sim=esim", *([] if wrong == "logger=wandb" else [wrong]))
    if wrong == "logger=wandb":
        with open_dict(cfg):
            cfg.logger = {
                "wandb": {
                    "_target_": "lightning.pytorch.loggers.WandbLogger", "_partial_": True
                }
            }  # fmt: skip
    with pytest.raises(SystemExit):
        train(cfg)
    assert caplog.messages[-1].startswith("Expected")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_trial_is_no_result(
    place: Path, real: DictConfig, caplog: pytest.LogCaptureFixture
) -> None:
    for trial in ("trainer.fast_dev_run=true", "trainer.limit_train_batches=1"):
        assert train(configured(place, "sim=real", trial, "recipe.epochs=1")) is None
        assert f"a trial, because of {trial.partition('=')[0]}: it leaves no" in caplog.text
    assert len(list(finished_runs(place / "runs/dsec_mini_smoke"))) == 1


@pytest.mark.slow
def test_what_is_done_anew_stays_until_the_new_result_is_there(
    place: Path, real: DictConfig, tmp_path: Path
) -> None:
    cfg = configured(place, "sim=real", f"paths.runs={tmp_path}", "recipe.epochs=2")
    before = train(cfg)
    anew = configured(
        place, "sim=real", f"paths.runs={tmp_path}", "recipe.epochs=2", "overwrite=true"
    )
    with open_dict(anew):
        anew.callbacks = {"progress": {"_target_": f"{__name__}.Cut"}}
    with pytest.raises(SystemExit):
        train(anew)
    (kept,) = finished_runs(tmp_path / "dsec_mini_smoke")
    assert kept.result == before
    assert kept.weights.is_file()
    after = train(cfg)
    (run,) = finished_runs(tmp_path / "dsec_mini_smoke")
    assert run.folder == job(cfg).run.folder
    assert after is not None
    assert [path.name for path in run.folder.parent.iterdir() if path.is_dir()] == [run.folder.name]


@pytest.mark.slow
def test_a_training_goes_on_for_longer(
    place: Path, real: DictConfig, caplog: pytest.LogCaptureFixture
) -> None:
    longer = configured(place, "sim=real", "recipe.epochs=3", "recipe.extends_epochs=2")
    shorter = weights(real)
    anew = job(configured(place, "sim=real", "recipe.epochs=3"))
    (found,) = shorter_ones(anew.run, anew.identity)  # who forgets the option is told of it
    assert found.folder == job(real).run.folder
    assert train(longer) is not None
    content = torch.load(job(longer).run.last_checkpoint, weights_only=True)
    assert content["global_step"] == 3
    assert content["lr_schedulers"][0]["total_steps"] == 3
    assert not all(torch.equal(a, b) for a, b in zip(shorter.values(), weights(longer).values()))  # noqa: B905
    for wrong in ("recipe.extends_epochs=1", "recipe.extends_epochs=3"):
        with pytest.raises(SystemExit):
            train(configured(place, "sim=real", "recipe.epochs=3", wrong))
    assert "Expected the finished training of 1 epochs at" in caplog.text
    assert "Expected a training of fewer than 3 epochs to extend, got 3" in caplog.text


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "named"),
    [
        ("sim=esim", "stream real instead of esim-"),
        ("recipe.epochs=4", "recipe.epochs 2 instead of 4"),
        ("recipe.batch_size=4", "recipe.batch_size 2 instead of 4"),
        ("seed=1", "seed 0 instead of 1"),
        ("trainer.gradient_clip_val=0.5", "trainer.gradient_clip_val 1.0 instead of 0.5"),
    ],
)
def test_the_checkpoint_of_another_training_is_refused(
    place: Path, real: DictConfig, caplog: pytest.LogCaptureFixture, change: str, named: str
) -> None:
    last = job(real).run.last_checkpoint
    with pytest.raises(SystemExit):
        train(configured(place, "sim=real", change, f"ckpt_path={last}"))
    assert named in caplog.messages[-1]
    assert "recipe.extends_epochs" in caplog.messages[-1]
    assert "model.weights" in caplog.messages[-1]


def changed_frame(recording) -> None:
    path = recording.frame_paths[0]
    Image.fromarray(255 - np.asarray(Image.open(path))).save(path)


def changed_time(recording) -> None:
    path = recording.folder / "images/timestamps.txt"
    times = path.read_text().split()
    path.write_text("\n".join([*times[:-1], str(int(times[-1]) + 1)]))


def changed_label(recording) -> None:
    path = recording.folder / "object_detections/left/tracks.npy"
    tracks = np.load(path)
    tracks["w"] += 1
    np.save(path, tracks)


@pytest.mark.slow
@pytest.mark.parametrize("change", [changed_frame, changed_time, changed_label])
def test_a_training_on_other_data_is_another_one(place: Path, tmp_path: Path, change) -> None:
    cfg = configured(place, f"data.root={tmp_path}")
    before = job(cfg).run.folder
    assert job(configured(place)).run.folder == before  # wherever the data lie
    change(dataset(cfg).recordings("train")[0])
    assert job(cfg).run.folder != before


@pytest.mark.parametrize(
    "change",
    ["trainer.max_epochs=1", "trainer.limit_train_batches=1", "trainer.precision=64-true",
     "trainer.accumulate_grad_batches=2", "trainer.gradient_clip_val=2",
     "trainer.fast_dev_run=true",
     "+callbacks.stop._target_=somewhere.Stop"],
)  # fmt: skip
def test_every_setting_that_changes_a_number_is_another_recipe(place: Path, change: str) -> None:
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        plain, other = (compose("train", overrides=each) for each in ([], [change]))
    assert recipe_hash(plain) != recipe_hash(other)


@pytest.mark.parametrize(
    "change",
    ["trainer=ddp", "trainer.devices=2", "logger=wandb", "callbacks=lines", "jobs=2",
     "datamodule.num_workers=3", "trainer.log_every_n_steps=1", "data.root=elsewhere",
     "trainer.num_sanity_val_steps=2", "+data.generator.workers=1"],
)  # fmt: skip
def test_how_it_is_computed_and_shown_is_not(place: Path, change: str) -> None:
    precision = "trainer.precision=32-true"
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        plain, other = (
            compose("train", overrides=each) for each in ([precision], [precision, change])
        )
    assert recipe_hash(plain) == recipe_hash(other)


def test_weights_to_start_from_count_by_content(tmp_path: Path) -> None:
    register_resolvers()

    def named(path: Path) -> str:
        with initialize_config_dir(str(CONFIGS), version_base="1.3"):
            return recipe_hash(compose("train", overrides=[f"model.weights={path}"]))

    one, same = tmp_path / "one.ckpt", tmp_path / "same.ckpt"
    one.write_bytes(b"weights")
    same.write_bytes(b"weights")
    before = named(one)
    assert named(same) == before
    one.write_bytes(b"others!")
    assert named(one) != before
    with pytest.raises(FileNotFoundError, match=r"found none; set model\.weights"):
        named(tmp_path / "nowhere.ckpt")
