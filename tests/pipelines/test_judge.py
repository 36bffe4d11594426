"""Which detector judges, where several could."""

import os
from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_dir

from eqs.files import write_json
from eqs.metrics import Centre, Definition
from eqs.pipelines import judge
from eqs.pipelines.runs import Run, recipe_hash

CONFIGS = Path(__file__).parents[2] / "eqs/configs"
ACCURACY = {"own": {}, "real": {}, "protocol": {}}


@pytest.fixture
def cfg(tmp_path):
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        return compose("evaluate", [f"paths.runs={tmp_path}"])


def finished(root, name, *, simulator="real", recipe="old", age_s=0):
    folder = root / "dsec_mini" / simulator / name
    folder.mkdir(parents=True)
    result = {"simulator": simulator, "system": simulator, "seed": 0, "recipe": recipe, **ACCURACY}
    write_json(folder / "result.json", result)
    os.utime(folder / "result.json", (1e9 - age_s, 1e9 - age_s))
    return Run(folder)


@pytest.fixture
def chosen(cfg, monkeypatch):
    monkeypatch.setattr(judge, "_trained_judge", lambda _, run: run)
    return lambda: judge.find_judge(cfg, None)


def test_the_configured_recipe_wins_over_a_newer_one(cfg, chosen, tmp_path):
    wanted = finished(tmp_path, "a", recipe=recipe_hash(cfg), age_s=100)
    finished(tmp_path, "b")
    assert chosen() == wanted


def test_else_the_newest_wins(chosen, tmp_path):
    finished(tmp_path, "a", age_s=100)
    wanted = finished(tmp_path, "b")
    finished(tmp_path, "c", age_s=50)
    assert chosen() == wanted


def test_detectors_of_simulated_streams_do_not_judge(chosen, tmp_path):
    finished(tmp_path, "a", simulator="esim")
    with pytest.raises(ValueError, match="Expected a judge trained on real events, got none"):
        chosen()


@pytest.mark.parametrize(
    ("features", "expected"),
    [
        ("centred", "hidden_centred hidden_raw gate_centred gate_raw"),
        ("raw", "hidden_raw hidden_centred gate_raw gate_centred"),
        (
            "whitened",
            "hidden_whitened hidden_raw hidden_centred gate_whitened gate_raw gate_centred",
        ),
    ],
)
def test_whitened_readings_appear_when_asked_for(features, expected):
    array = np.eye(2, dtype=np.float32)
    centres = {
        tap: Centre(tap=tap, stages=(1,), means=(array[0],), covariances=(array,))
        for tap in ("hidden", "gate")
    }
    definition = Definition(features=features, stages=(1,))
    readings = judge._readings(["hidden", "gate"], definition, centres)
    assert [reading.name for reading in readings] == expected.split()


def given(tmp_path, *overrides):
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        options = ["eqs.weights=random", "eqs.size=tiny", f"eqs.centre={tmp_path / 'c.npz'}"]
        return compose("evaluate", [*options, *overrides])


def test_a_given_centre_belongs_to_given_weights(tmp_path):
    widths = {"stages": (1, 2, 3), "means": tuple(np.ones(n, np.float32) for n in (32, 64, 128))}
    centre = Centre(tap="hidden", **widths)
    centre.save(tmp_path / "c.npz")
    found = judge.find_judge(given(tmp_path), None)
    assert found.headline.name == "hidden_centred"
    assert found.headline.centre.sha256 == centre.sha256
    assert {reading.name for reading in found.readings} >= {"hidden_raw", "gate_raw"}
    assert "gate_centred" not in {reading.name for reading in found.readings}
    with pytest.raises(ValueError, match=r"centre of the activation gate, got one of hidden"):
        judge.find_judge(given(tmp_path, "eqs.tap=gate"), None)
    with pytest.raises(ValueError, match=r"Expected weights beside the centre .*set eqs\.weights"):
        judge.find_judge(given(tmp_path, "eqs.weights=null"), None)
