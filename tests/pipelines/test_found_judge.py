"""Which detector judges, where several could."""

import os
import shutil
from pathlib import Path

import pytest
import torch
from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf

from eqs.events import EventReader
from eqs.metrics import EventQualityScore, Judge
from eqs.metrics.definition import VERSION_1
from eqs.models import RVTDetector
from eqs.pipelines import judge, scoring
from eqs.pipelines.build import dataset
from eqs.pipelines.recipe import recipe_hash
from eqs.pipelines.resolvers import register_resolvers
from eqs.pipelines.runs import Run

RVT = "eqs.models.RVTDetector"
CONFIGS = Path(__file__).parents[2] / "eqs/configs"


@pytest.fixture
def cfg(tmp_path):
    register_resolvers()
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        return compose("evaluate", [f"paths.runs={tmp_path}"])


@pytest.fixture
def finished(result_of):
    def make(root, name, *, simulator="real", recipe="old", age_s=0, target=RVT):
        run = Run(root / "dsec_mini" / simulator / name)
        run.save_config(OmegaConf.create({"model": {"_target_": target}}), {})
        run.finish(result_of(simulator, recipe=recipe))
        os.utime(run.folder / "result.json", (1e9 - age_s, 1e9 - age_s))
        return run

    return make


@pytest.fixture
def chosen(cfg, monkeypatch):
    monkeypatch.setattr(judge, "judge_of", lambda run: run)
    monkeypatch.setattr(judge, "_data_of", lambda run: None)
    return lambda: judge.find_judge(cfg, None)[0]


def test_the_configured_recipe_wins_over_a_newer_one(cfg, chosen, finished, tmp_path):
    wanted = finished(tmp_path, "a", recipe=recipe_hash(cfg), age_s=100)
    finished(tmp_path, "b")
    assert chosen() == wanted


def test_else_the_newest_wins(chosen, finished, tmp_path):
    finished(tmp_path, "a", age_s=100)
    wanted = finished(tmp_path, "b")
    finished(tmp_path, "c", age_s=50)
    assert chosen() == wanted


def test_without_a_detector_of_real_events_the_package_s_judge_judges(chosen, finished, tmp_path):
    finished(tmp_path, "a", simulator="esim")
    brought = chosen()
    assert brought.weights_sha256 == Judge.load("varied").weights_sha256


@pytest.mark.parametrize("target", ["torch.nn.Linear", "gone.Detector"])
def test_detectors_without_taps_do_not_judge(chosen, finished, tmp_path, target):
    wanted = finished(tmp_path, "a", age_s=100)
    finished(tmp_path, "b", target=target)
    assert chosen() == wanted


@pytest.mark.parametrize(
    ("features", "expected"),
    [
        ("centred", "hidden_centred hidden_raw gate_centred gate_raw"),
        ("raw", "hidden_raw hidden_centred gate_raw gate_centred"),
        (
            "whitened",
            "hidden_whitened hidden_centred hidden_raw gate_whitened gate_centred gate_raw",
        ),
        (
            "silence",
            "hidden_silence hidden_centred hidden_raw gate_silence gate_centred gate_raw",
        ),
    ],
)
def test_whitened_readings_appear_when_asked_for(features, expected, make_events):
    recording = make_events(3000, 32, 32)
    trained = Judge.random(size="tiny").centred_on([recording], ["hidden", "gate"])
    chosen = {**VERSION_1, "features": features} if features != "silence" else {}
    metric = EventQualityScore(trained, **chosen)
    readings = scoring.readings_of(metric, ["hidden", "gate"])
    assert [reading.name for reading in readings] == expected.split()


def test_a_given_folder_is_the_judge(tmp_path, make_events):
    Judge.random(size="tiny").centred_on([make_events(3000, 32, 32)]).save(tmp_path / "mine")
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose("evaluate", [f"eqs.judge={tmp_path / 'mine'}", f"paths.runs={tmp_path}"])
        gate = compose(
            "evaluate", ["metric=eqs_1", f"eqs.judge={tmp_path / 'mine'}", "eqs.tap=gate"]
        )
    found = scoring.find_scoring(cfg, None)
    assert found.headline.name == "hidden_silence"
    assert found.judge.weights_sha256 == Judge.load(tmp_path / "mine").weights_sha256
    names = {reading.name for reading in found.readings}
    taps = ("hidden", "gate", "downsample")
    plain = {f"{tap}_{features}" for tap in taps for features in ("silence", "raw")}
    assert names == {"hidden_centred", *plain}
    with pytest.raises(ValueError, match=r"centre of the activation gate.* set eqs\.judge, or"):
        scoring.find_scoring(gate, None)


def test_a_checkpoint_is_centred_on_the_training_recordings_and_kept(tmp_path, make_recording):
    for split in ("train", "test"):
        make_recording(tmp_path / "data" / split / f"{split}_a", height=32, width=32)
    torch.manual_seed(0)
    detector = RVTDetector("tiny", partition_split_32=1)
    torch.save({"state_dict": detector.state_dict()}, tmp_path / "some.ckpt")
    given = [
        f"eqs.judge={tmp_path / 'some.ckpt'}",
        "eqs.partition_split_32=1",
        f"paths.results={tmp_path / 'results'}",
        "data=dsec",
        f"data.root={tmp_path / 'data'}",
        "data.size=32x32",
        "data.crop_rows=null",
        "data.splits={train: [train_a], val: [], test: [test_a]}",
    ]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose("evaluate", given)
    found = scoring.find_scoring(cfg, dataset(cfg))
    (kept,) = (tmp_path / "results" / "dsec").glob("judge-*")
    assert Judge.load(kept).reading(**VERSION_1).centre.sha256 == centre_of(found)
    shutil.rmtree(tmp_path / "data" / "train")
    again = scoring.find_scoring(cfg, None)
    assert centre_of(again) == centre_of(found)


def centre_of(found):
    (centred,) = (each for each in found.readings if each.name == "hidden_centred")
    return centred.centre.sha256


def test_centres_follow_the_recordings_they_were_computed_from(tmp_path, make_recording):
    for index, name in enumerate(("train_a", "test_a")):
        make_recording(tmp_path / "data" / name, height=32, width=32, seed=index)
    torch.manual_seed(0)
    detector = RVTDetector("tiny", partition_split_32=1)
    torch.save({"state_dict": detector.state_dict()}, tmp_path / "some.ckpt")
    Judge.random(size="tiny").centred_on(
        [EventReader(tmp_path / "data/test_a/events/left/events.h5", 32, 32)]
    ).save(tmp_path / "published")
    found = {}
    for step in ("half", "whole", "again"):
        if step == "whole":  # the rest of the download
            make_recording(tmp_path / "data/train_b", height=32, width=32, seed=2)
        for judge_named in ("some.ckpt", "published"):
            with initialize_config_dir(str(CONFIGS), version_base="1.3"):
                cfg = compose(
                    "evaluate",
                    [
                        f"eqs.judge={tmp_path / judge_named}",
                        f"paths.results={tmp_path / 'results'}",
                        "data=dsec",
                        f"data.root={tmp_path / 'data'}",
                        "data.size=32x32",
                        "data.crop_rows=null",
                        "data.splits={train: [train_*], val: [], test: [test_a]}",
                    ],
                )
            found[judge_named, step] = centre_of(scoring.find_scoring(cfg, dataset(cfg)))
    assert found["some.ckpt", "half"] != found["some.ckpt", "whole"]
    assert found["some.ckpt", "whole"] == found["some.ckpt", "again"]
    assert len({found["published", step] for step in ("half", "whole", "again")}) == 1
    assert len(list((tmp_path / "published").glob("centre-*"))) == 1
