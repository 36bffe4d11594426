"""The parameter files mirror the parameters, and every setting composes."""

from dataclasses import fields
from itertools import pairwise
from pathlib import Path

import pytest
import yaml
from hydra import compose, initialize_config_dir
from hydra.errors import MissingConfigException
from hydra.utils import instantiate

from eqs.data import RecordedEvents
from eqs.frames import Lens, Light
from eqs.pipelines.resolvers import register_resolvers
from eqs.simulators import (
    ADV2E,
    CARLA,
    ESIM,
    ICNS,
    PECS,
    PIX2NVS,
    V2E,
    Bottleneck,
    DVSPixel,
    DVSVoltmeter,
    EventGAN,
    Gazebo,
    ImprovedESIM,
    Learning,
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
    "pecs": PECS,
    "adv2e": ADV2E,
    "eventgan": EventGAN,
    "dvs_pixel": DVSPixel,
}
GROUPS = ("interpolation", "readout", "light", "lens")
LIT = {
    "pecs": Light(weights="photodiode"),
    "adv2e": Light(),
    "dvs_pixel": Light(),
}  # those that begin with the light
READOUTS = {"bottleneck": Bottleneck, "row": RowReadout, "synchronous": SynchronousReadout}
SETTINGS = sorted(
    path.relative_to(CONFIGS / "sim").with_suffix("").as_posix()
    for path in (CONFIGS / "sim").glob("*/*.yaml")
)


def composed(*overrides, program="train"):
    """What a program gets."""
    register_resolvers()
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        return compose(program, [*overrides])


def stated(name):
    """What a simulator's file and the one that it builds on say."""
    files = [CONFIGS / "base" / "simulator.yaml", CONFIGS / "sim" / f"{name}.yaml"]
    read = [yaml.safe_load(path.read_text()) for path in files]
    first, *_, last = read[1].pop("defaults")
    assert (first, last) == ("/base/simulator@_here_", "_self_")
    assert read[0].keys() & read[1].keys() == ({"light"} if name in LIT else set())
    return {**read[0], **read[1]}


def test_the_recorded_events_have_nothing_to_set():
    values = yaml.safe_load((CONFIGS / "sim" / "real.yaml").read_text())
    assert values == {"_target_": "eqs.data.RecordedEvents"}
    assert instantiate(values) == RecordedEvents()


@pytest.mark.parametrize("name", SIMULATORS)
def test_a_parameter_file_has_exactly_the_defaults(name):
    kind = SIMULATORS[name]
    values = stated(name)
    assert values.pop("_target_") == f"eqs.simulators.{kind.__name__}"
    assert kind.name == name
    if name == "eventgan":
        check_learning(values.pop("network"))
    expected = {field.name: field.default for field in fields(kind) if field.name in values}
    if "seed" in expected:
        expected["seed"] = "${seed}"
    expected |= {group: f"${{oc.select:{group},null}}" for group in GROUPS}
    if expected_light := LIT.get(name):
        expected["light"] = values["light"]
        assert instantiate(composed(f"sim={name}").sim).light == expected_light
        assert instantiate(composed(f"sim={name}", "light=none").sim).light is None
    assert values == expected
    assert {key: type(value) for key, value in values.items()} == {
        key: type(value) for key, value in expected.items()
    }


def check_learning(values):
    assert values.pop("_target_") == "eqs.simulators.Learning"
    assert values.pop("root") == "${paths.runs}/simulators"
    learning = instantiate(composed("sim=eventgan").sim).network
    defaults = {field.name: field.default for field in fields(Learning)}
    del defaults["teacher"], defaults["root"]
    assert values.keys() == defaults.keys()
    assert {name: getattr(learning, name) for name in defaults} == defaults


@pytest.mark.parametrize("file", ["base/simulator", *(f"sim/{name}" for name in SIMULATORS)])
def test_every_parameter_has_a_comment_with_source_and_range(file):
    lines = (CONFIGS / f"{file}.yaml").read_text().splitlines()
    for above, line in pairwise(lines):
        named = line.strip()
        if named and not named.startswith(("#", "_target_", "mode", "seed", "defaults", "- ")):
            assert above.strip().startswith("# "), line
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


def test_a_lens_stands_before_every_simulator():
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose("evaluate", ["lens=thin", "lens.blur_px=1"])
    for simulator in cfg.simulators.values():
        assert instantiate(simulator).lens == Lens(blur_px=1)


def test_eventgan_learns_from_another_sensor_or_from_that_of_the_data():
    foreign, own = (
        instantiate(composed(f"sim={each}").sim) for each in ("eventgan", "eventgan/own")
    )
    names = [each.network.teacher.name for each in (foreign, own)]
    assert names == ["dsec_mini_foreign", "dsec_mini"]
    sensors = {each.network.teacher.sensor_hash for each in (foreign, own)}
    assert len(sensors) == 2
    assert (foreign.caveat("dsec_mini"), bool(own.caveat("dsec_mini"))) == ("", True)
    little = instantiate(composed("sim=eventgan", "experiment=smoke").sim).network
    assert (little.epochs, little.teacher.name) == (2, "dsec_mini_foreign_smoke")
    on_files = composed("sim=eventgan/own", "data=dsec", "data.root=somewhere")
    assert instantiate(on_files.sim).network.teacher.name == "dsec"


def test_every_simulator_has_a_parameter_file():
    assert {path.stem for path in (CONFIGS / "sim").glob("*.yaml")} == {
        *SIMULATORS,
        "real",
        "files",
        "mix",
        "volumes",  # which needs a network of the user's
    }


@pytest.mark.parametrize("setting", SETTINGS)
def test_every_setting_changes_its_simulator_wherever_that_stands(setting):
    name = setting.partition("/")[0]
    simulator = instantiate(composed(f"sim={setting}").sim)
    plain = instantiate(composed(f"sim={name}").sim)
    assert simulator.name == plain.name == name
    assert simulator != plain
    elsewhere = composed(f"+sim@simulators.mine={setting}", program="evaluate").simulators.mine
    assert instantiate(elsewhere) == simulator
    text = (CONFIGS / "sim" / f"{setting}.yaml").read_text()
    own = {key: value for key, value in yaml.safe_load(text).items() if key != "defaults"}
    plainly = {key: value for key, value in own.items() if key != "network"}
    assert all(getattr(simulator, key) == value for key, value in plainly.items())
    changed = {key for key in own if getattr(simulator, key) != getattr(plain, key)}
    assert changed


def test_the_setting_of_the_paper_has_its_thresholds():
    simulator = instantiate(composed("sim=v2e/paper", "seed=7").sim)
    assert (simulator.threshold_on_log, simulator.threshold_off_log) == (0.3, 0.3)
    assert simulator.threshold_sigma_log == 0.03
    assert simulator.seed == 7


def test_the_command_line_overrides_a_setting():
    config = composed("sim=v2e/paper", "sim.threshold_on_log=0.25")
    assert instantiate(config.sim).threshold_on_log == 0.25


def test_an_unknown_setting_is_refused_by_hydra_with_those_that_there_are():
    with pytest.raises(MissingConfigException, match=r"Could not find 'sim/v2e/papre'"):
        composed("sim=v2e/papre")


def test_the_experiment_of_all_simulators_leaves_none_out():
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose("evaluate", ["experiment=all_simulators"])
    assert set(cfg.simulators) == set(SIMULATORS)
