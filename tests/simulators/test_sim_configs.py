"""The parameter files mirror the parameters, and every preset composes."""

from dataclasses import fields
from itertools import pairwise
from pathlib import Path

import pytest
import yaml
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate

from eqs.data import RecordedEvents
from eqs.simulators import (
    CARLA,
    ESIM,
    ICNS,
    PIX2NVS,
    V2E,
    Bottleneck,
    DVSVoltmeter,
    Gazebo,
    ImprovedESIM,
    Prophesee,
    RowReadout,
    SynchronousReadout,
    Vid2E,
)

CONFIGS = Path(__file__).parents[2] / "eqs/configs"
SIMULATORS = {
    "esim": ESIM,
    "v2e": V2E,
    "pix2nvs": PIX2NVS,
    "prophesee": Prophesee,
    "carla": CARLA,
    "gazebo": Gazebo,
    "dvs_voltmeter": DVSVoltmeter,
    "icns": ICNS,
    "improved_esim": ImprovedESIM,
    "vid2e": Vid2E,
}
READOUTS = {"bottleneck": Bottleneck, "row": RowReadout, "synchronous": SynchronousReadout}
PRESETS = sorted(path.stem for path in (CONFIGS / "sim_preset").glob("*.yaml"))

CHANGED = (
    *(f"{name}_dsec" for name in ("esim", "v2e", "prophesee", "icns", "improved_esim")),
    "esim_noisy",
    "v2e_paper",
    "v2e_clean",
    "v2e_noisy",
    "prophesee_clean",
    "prophesee_noisy",
    "dvs_voltmeter_clean",
    "dvs_voltmeter_davis240",
    "icns_clean",
    "improved_esim_clean",
)


def composed(tmp_path, *overrides):
    """What a program gets whose defaults name a simulator and a preset."""
    (tmp_path / "main.yaml").write_text(
        "defaults: [_self_, {sim: esim}, {preset: default}, {sim_preset: '${sim}_${preset}'}]\n"
        f"hydra: {{searchpath: ['file://{CONFIGS}']}}\nseed: 7\n"
    )
    with initialize_config_dir(str(tmp_path), version_base=None):
        return compose("main", overrides=list(overrides))


def test_the_recorded_events_have_nothing_to_set():
    values = yaml.safe_load((CONFIGS / "sim" / "real.yaml").read_text())
    assert values == {"_target_": "eqs.data.RecordedEvents"}
    assert instantiate(values) == RecordedEvents()


@pytest.mark.parametrize("name", SIMULATORS)
def test_a_parameter_file_has_exactly_the_defaults(name):
    kind = SIMULATORS[name]
    values = yaml.safe_load((CONFIGS / "sim" / f"{name}.yaml").read_text())
    assert values.pop("_target_") == f"eqs.simulators.{kind.__name__}"
    assert kind.name == name
    expected = {field.name: field.default for field in fields(kind)}
    if "seed" in expected:
        expected["seed"] = "${seed}"
    for group in ("interpolation", "readout"):
        if group in expected:
            expected[group] = f"${{oc.select:{group},null}}"
    assert values == expected
    assert {key: type(value) for key, value in values.items()} == {
        key: type(value) for key, value in expected.items()
    }


@pytest.mark.parametrize("name", SIMULATORS)
def test_every_parameter_has_a_comment_with_source_and_range(name):
    lines = (CONFIGS / "sim" / f"{name}.yaml").read_text().splitlines()
    for above, line in pairwise(lines):
        if not line.startswith(("#", "_target_", "mode", "seed")):
            assert above.startswith("# "), line
            assert "Source: " in above, line
            assert any(word in above for word in ("Typical ", "Range ", "One of ")), line


@pytest.mark.parametrize("name", READOUTS)
def test_a_readout_file_has_exactly_the_defaults_and_says_whence(name):
    text = (CONFIGS / "readout" / f"{name}.yaml").read_text()
    values = yaml.safe_load(text)["readout"]
    assert values.pop("_target_") == f"eqs.simulators.{READOUTS[name].__name__}"
    assert values == {field.name: field.default for field in fields(READOUTS[name])}
    (source,) = [line for line in text.splitlines() if "Source: " in line]
    assert "microseconds. " in source
    assert "Typical " in source


@pytest.mark.parametrize("program", ["simulate", "train", "calibrate"])
def test_every_program_offers_every_readout(program):
    names = {path.stem for path in (CONFIGS / "readout").glob("*.yaml")}
    assert names == {*READOUTS, "none"}
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        for name in names:
            cfg = compose(program, ["sim=icns", f"readout={name}"])
            expected = ICNS(readout=READOUTS[name]() if name in READOUTS else None)
            assert instantiate(cfg.sim) == expected


def test_a_readout_holds_for_every_simulator_of_an_evaluation():
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose("evaluate", ["readout=row", "readout.service_us=3"])
    for simulator in cfg.simulators.values():
        assert instantiate(simulator).readout == RowReadout(service_us=3)


def test_every_simulator_has_a_parameter_file():
    assert {path.stem for path in (CONFIGS / "sim").glob("*.yaml")} == {*SIMULATORS, "real"}


@pytest.mark.parametrize("pair", PRESETS)
def test_every_preset_composes_and_builds(tmp_path, pair):
    name, _, preset = pair.rpartition("_")
    config = composed(tmp_path, f"sim={name}", f"preset={preset}")
    simulator = instantiate(config.sim)
    assert simulator.name == name
    defaults = instantiate(composed(tmp_path, f"sim={name}").sim)
    assert (simulator == defaults) == (pair not in CHANGED)


def test_every_simulator_has_default_and_paper():
    assert {f"{name}_{preset}" for name in SIMULATORS for preset in ("default", "paper")} <= set(
        PRESETS
    )
    words = {path.stem for path in (CONFIGS / "preset").glob("*.yaml")}
    assert {pair.rpartition("_")[2] for pair in PRESETS} == words


def test_the_paper_preset_states_the_papers_thresholds(tmp_path):
    simulator = instantiate(composed(tmp_path, "sim=v2e", "preset=paper").sim)
    assert (simulator.threshold_on_log, simulator.threshold_off_log) == (0.3, 0.3)
    assert simulator.threshold_sigma_log == 0.03
    assert simulator.seed == 7


def test_the_command_line_overrides_a_preset(tmp_path):
    config = composed(tmp_path, "sim=v2e", "preset=paper", "sim.threshold_on_log=0.25")
    assert instantiate(config.sim).threshold_on_log == 0.25


def test_the_experiment_of_all_simulators_leaves_none_out():
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose("evaluate", ["experiment=all_simulators"])
    assert set(cfg.simulators) == set(SIMULATORS)
