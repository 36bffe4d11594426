"""Another event camera for the rendered street: what depends on it, and what does not."""

from pathlib import Path

import pandas as pd
import pytest
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate
from omegaconf import DictConfig, open_dict

import eqs
from eqs.data import MixedEvents, RecordedEvents, SimulatedEvents
from eqs.pipelines import train as training
from eqs.pipelines.build import dataset, event_source
from eqs.pipelines.comparable import comparable_runs
from eqs.pipelines.evaluate import evaluate
from eqs.pipelines.recipe import data_hash, recipe_hash
from eqs.pipelines.resolvers import register_resolvers
from eqs.pipelines.result import RunResult
from eqs.pipelines.runs import Run, finished_runs
from eqs.pipelines.sensors import (
    check_sensor,
    named,
    other_sensor,
    own_events,
    require_events,
    results_folder,
    sensor_label,
)
from eqs.pipelines.start import named as named_stages
from eqs.pipelines.testing import sees_real
from eqs.pipelines.train import run_of, train
from eqs.simulators import ESIM

CONFIGS = Path(eqs.__file__).parent / "configs"
DAVIS = "davis346-9bb18708551c"
QUIET = pytest.mark.filterwarnings("ignore:.*LeafSpec.*:FutureWarning", "ignore:.*many workers")


def composed(*overrides: str, name: str = "train") -> DictConfig:
    register_resolvers()
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        return compose(name, overrides=list(overrides))


def configured(place: Path, *overrides: str, name: str = "train") -> DictConfig:
    paths = [f"paths.{key}={place / key}" for key in ("datasets", "simulated", "runs", "results")]
    small = [
        "experiment=smoke",
        "data.size=64x48",
        "data.generator.frames=6",
        "data.generator.sequences={train: 1, val: 1, test: 2}",
        "+data.generator.workers=1",
        "recipe.epochs=1",
        "recipe.steps_per_epoch=1",
        "recipe.validate_every_epochs=1",
        "task.confidence_threshold=1e-5",
    ]
    cfg = composed(*small, *paths, *overrides, name=name)
    with open_dict(cfg):
        cfg.callbacks = {}
    return cfg


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("sensors")


@pytest.mark.parametrize("verb", ["train", "evaluate", "prepare", "check", "calibrate", "score"])
def test_every_verb_on_rendered_data_takes_a_sensor(verb: str) -> None:
    cfg = composed("sensor=davis346", name=verb)
    check_sensor(cfg)
    assert sensor_label(cfg) == DAVIS
    assert instantiate(cfg.data).sensor_hash == "9bb18708551c"
    assert results_folder(composed(name=verb)) == Path("results/dsec_mini")


@pytest.mark.parametrize("verb", ["simulate", "train-simulator"])
def test_verbs_without_results_take_one_too(verb: str) -> None:
    cfg = composed("sensor=gen4", "data=dsec_mini", name=verb)
    check_sensor(cfg)
    assert sensor_label(cfg) == "gen4-e7a7e3bdc42b"


def test_the_default_and_its_name_are_the_same() -> None:
    for chosen in ([], ["sensor=reference_sensor"]):
        cfg = composed(*chosen)
        assert other_sensor(cfg) is None
        assert instantiate(cfg.data).sensor_hash == "51f1ba55d567"
    assert named("51f1ba55d567").words == "reference_sensor (51f1ba55d567)"


def test_a_changed_camera_is_another_without_a_name() -> None:
    cfg = composed("sensor=davis346", "sensor.leak_hz=0.4")
    found = other_sensor(cfg)
    assert found is not None
    assert found.name == "own"
    assert found.hash != "9bb18708551c"
    assert results_folder(cfg) == Path("results/dsec_mini/sensors") / found.label


@pytest.mark.parametrize(
    ("verb", "overrides", "said"),
    [
        ("train", ["data=dsec", "data.root=there"], "data=dsec,"),
        ("evaluate", ["data=recordings", "data.root=there"], "data=recordings,"),
        ("simulate", ["frames=clip.mp4"], "a data set"),
    ],
)
def test_where_there_is_no_sensor_to_choose_a_sentence_says_so(verb, overrides, said) -> None:
    with pytest.raises(ValueError, match=rf"Expected .*{said} .*set data=dsec_mini, or leave"):
        check_sensor(composed("sensor=gen4", *overrides, name=verb))
    check_sensor(composed(*overrides, name=verb))


def test_the_recipe_does_not_depend_on_the_sensor() -> None:
    assert recipe_hash(composed("sensor=gen4")) == recipe_hash(composed())


def test_what_learns_from_the_sensor_goes_on_doing_so() -> None:
    cfg = composed("sensor=gen4", "sim=eventgan/own")
    teachers = [instantiate(each.sim).network.teacher for each in (cfg, own_events(cfg))]
    assert {each.sensor_hash for each in teachers} == {"e7a7e3bdc42b"}
    foreign = instantiate(composed("sensor=gen4", "sim=eventgan").sim).network.teacher
    assert foreign.sensor_hash == "5a7466f2d6aa"


def test_only_streams_with_real_events_depend_on_the_sensor(tmp_path: Path) -> None:
    real, esim = RecordedEvents(), SimulatedEvents(ESIM(), tmp_path)

    def mixed(share: float, evaluated_on: str = "esim") -> MixedEvents:
        sources, shares = {"real": real, "esim": esim}, {"real": share, "esim": 1.0}
        return MixedEvents(sources=sources, shares=shares, evaluated_on=evaluated_on, seed=0)

    assert [sees_real(each) for each in (real, esim)] == [True, False]
    assert [sees_real(each) for each in (mixed(0.1), mixed(0.0), mixed(0.0, "real"))] == [
        True, False, True
    ]  # fmt: skip


def test_what_starts_from_real_events_says_of_which_sensor(result_of) -> None:
    own, other = result_of("real"), result_of("real", sensor=DAVIS)
    assert named_stages(own) == ({"real": 1.0},)
    assert named_stages(other) == ({f"real of {DAVIS}": 1.0},)
    assert named_stages(result_of("esim", sensor=DAVIS)) == ({"esim": 1.0},)


def folders(place: Path, sim: str, *chosen: str) -> Path:
    """Where a training would lie."""
    cfg = configured(place, f"sim={sim}", *chosen)
    source = event_source(cfg.sim, cfg)
    own = cfg if sees_real(source) else own_events(cfg)
    return run_of(own, source, data_hash(dataset(own))).folder


@pytest.mark.slow
def test_a_key_names_the_sensor_where_real_events_are_seen(place: Path) -> None:
    assert folders(place, "esim") == folders(place, "esim", "sensor=davis346")
    assert not list(place.glob("datasets/*_sensors"))  # nor were its events needed
    assert folders(place, "real") != folders(place, "real", "sensor=davis346")
    assert folders(place, "real") == folders(place, "real", "sensor=reference_sensor")
    seen = dataset(configured(place, "sensor=davis346"))
    own = dataset(configured(place))
    for split in ("train", "val", "test"):
        for one, other in zip(seen.recordings(split), own.recordings(split), strict=True):
            assert one.frames_hash() == other.frames_hash()
            assert one.frame_paths == other.frame_paths
            assert one.label_paths == other.label_paths
            assert one.events_path.read_bytes() != other.events_path.read_bytes()


@pytest.mark.slow
def test_a_check_does_not_make_events(place: Path) -> None:
    cfg = configured(place, "sensor=low_light")
    found = other_sensor(cfg)
    assert found is not None
    with pytest.raises(ValueError, match=r"low_light \(7befbfdf9ed3\).*prepare\.py"):
        require_events(dataset(cfg), found)


@pytest.fixture(scope="module")
def esim(place: Path) -> RunResult:
    result = train(configured(place, "sim=esim"))
    assert result is not None
    return result


@pytest.mark.slow
def test_a_detector_is_tested_on_another_sensor_without_a_training(
    place: Path, esim: RunResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> bool:
        raise AssertionError("trained again")

    monkeypatch.setattr(training, "execute", refuse)
    found = train(configured(place, "sim=esim", "sensor=davis346"))
    assert found is not None
    assert (found.sensor, found.system, found.recipe) == (DAVIS, esim.system, esim.recipe)
    assert found.own == esim.own  # the same detector on the same frames
    assert found.real.ground_truths_per_class == esim.real.ground_truths_per_class
    assert train(configured(place, "sim=esim")) == esim
    with pytest.raises(AssertionError, match="trained again"):
        train(configured(place, "sim=real", "sensor=davis346"))


@QUIET
@pytest.mark.slow
def test_runs_of_another_sensor_s_events_are_left_out(
    place: Path, esim: RunResult, result_of, caplog: pytest.LogCaptureFixture
) -> None:
    cfg = configured(place, "sensor=gen4", name="evaluate")
    run = next(run for run in finished_runs(place / "runs/dsec_mini_smoke"))
    content = data_hash(dataset(cfg))
    for sensor, data in (("", esim.data), (DAVIS, "other"), (sensor_label(cfg), content)):
        real = Run(place / "others" / f"real{sensor}" / "a-seed0")
        real.finish(result_of("real", recipe=esim.recipe, data=data, sensor=sensor))
    others = list(finished_runs(place / "others"))
    with caplog.at_level("INFO"):
        found = comparable_runs(cfg, [run, *others])
    assert [(each.result.simulator, each.result.sensor) for each in found] == [
        ("esim", "gen4-e7a7e3bdc42b"), ("real", "gen4-e7a7e3bdc42b")
    ]  # fmt: skip
    assert "real events of the own sensor" in caplog.text
    assert f"real events of {DAVIS}" in caplog.text
    here = comparable_runs(configured(place, name="evaluate"), [run, *others])
    assert [each.result.simulator for each in here] == ["esim", "real"]
    assert {each.result.sensor for each in here} == {""}


@QUIET
@pytest.mark.slow
def test_an_accuracy_is_measured_anew_when_the_test_changed(
    place: Path, esim: RunResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    cfg = configured(place, "sensor=davis346", name="evaluate")
    runs = list(finished_runs(place / "runs/dsec_mini_smoke"))
    (there,) = comparable_runs(cfg, runs)
    before = there.record.stat().st_mtime_ns
    (again,) = comparable_runs(cfg, runs)
    assert again.record.stat().st_mtime_ns == before
    events = dataset(cfg).recordings("test")[0].events_path
    events.unlink()  # as if lost: made again with the same content, so that the result stays
    comparable_runs(cfg, runs)
    assert there.record.stat().st_mtime_ns == before
    monkeypatch.setattr("eqs.pipelines.testing.short_hash", lambda _: "other content")
    comparable_runs(cfg, runs)
    assert there.record.stat().st_mtime_ns > before


@pytest.mark.slow
def test_a_study_over_sensors_is_joined(
    place: Path, esim: RunResult, capsys: pytest.CaptureFixture[str]
) -> None:
    small = ["eqs.judge=random", "score=true", "~simulators.v2e", "~simulators.pix2nvs"]
    for chosen in ("reference_sensor", "davis346"):
        evaluate(configured(place, *small, f"sensor={chosen}", name="evaluate"))
    results = place / "results/dsec_mini_smoke"
    table = pd.read_csv(results / "sensors.csv").set_index("sensor")
    assert list(table.index) == ["reference_sensor-51f1ba55d567", DAVIS]
    assert table["eqs"].nunique() == 2
    assert table["weights_sha256"].nunique() == 1
    study = pd.read_csv(results / "sensors" / DAVIS / "study.csv")
    assert list(study["sensor"]) == [DAVIS]
    assert table.loc[DAVIS, "map_real"] == pytest.approx(study["map_real"].item())
    report = (results / "sensors" / DAVIS / "report.html").read_text()
    assert "sensor davis346" in report
    assert "9bb18708551c" in report
    assert "reference sensor" not in report
    said = capsys.readouterr().out
    assert "sensor: davis346 (9bb18708551c)" in said
    assert "Event Quality Score by sensor" in said
