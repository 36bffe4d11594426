"""Run folders, their recipe and the sentence a mistake ends in."""

import json
import logging
from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate
from omegaconf import DictConfig, OmegaConf

import eqs
from eqs.pipelines.command import explained
from eqs.pipelines.evaluate import short_names
from eqs.pipelines.recipe import recipe_hash
from eqs.pipelines.resolvers import register_resolvers
from eqs.pipelines.runs import Run, finished_runs
from eqs.pipelines.timing import PhaseTimes

CONFIGS = Path(eqs.__file__).parent / "configs"


def composed(*overrides: str, name: str = "train") -> DictConfig:
    register_resolvers()
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        return compose(name, overrides=list(overrides))


@pytest.mark.parametrize("data", ["dsec_mini", "dsec_mini_smoke", "dsec"])
@pytest.mark.parametrize("sim", ["real", "esim", "v2e", "pix2nvs"])
def test_every_combination_composes_and_resolves(data: str, sim: str) -> None:
    cfg = composed(f"data={data}", f"sim={sim}", *(["data.root=somewhere"] * (data == "dsec")))
    OmegaConf.resolve(cfg)
    assert instantiate(cfg.sim).name == sim
    assert cfg.model.num_classes == 3


@pytest.mark.parametrize("trainer", ["cpu", "auto", "gpu", "ddp"])
def test_every_trainer_preset_composes(trainer: str) -> None:
    cfg = composed(f"trainer={trainer}")
    OmegaConf.resolve(cfg)
    assert cfg.trainer.use_distributed_sampler is False


def test_a_recipe_is_the_same_for_training_and_evaluation_and_for_every_stream() -> None:
    assert recipe_hash(composed("sim=esim")) == recipe_hash(composed("sim=real", "seed=3"))
    assert recipe_hash(composed()) == recipe_hash(composed(name="evaluate"))


@pytest.mark.parametrize(
    "change",
    ["recipe.learning_rate=0.1", "model=rvt_tiny", "protocol=dsec8", "data.size=160x120"],
)
def test_whatever_makes_detectors_incomparable_changes_the_recipe(change: str) -> None:
    assert recipe_hash(composed(change)) != recipe_hash(composed())


def test_where_files_lie_does_not_change_the_recipe() -> None:
    elsewhere = composed("paths.datasets=elsewhere", "datamodule.histogram_cache=there")
    assert recipe_hash(elsewhere) == recipe_hash(composed())


def test_readers_help_a_gpu_and_leave_a_cpu_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eqs.pipelines.resolvers.available_cores", lambda: 3)
    for there, readers in ((False, 0), (True, 3)):
        monkeypatch.setattr("torch.cuda.is_available", lambda there=there: there)
        assert composed().datamodule.num_workers == readers


def test_a_result_is_read_as_it_was_written_and_named_where_it_lacks_something(
    tmp_path: Path, result_of
) -> None:
    run = Run(tmp_path / "esim-1" / "a-seed0")
    run.finish(result_of("esim"))
    assert run.result == result_of("esim")
    record = json.loads((run.folder / "result.json").read_text())
    for spoilt in ({"seed": 1}, {**record, "own": {"map": 0.1}}, {**record, "own": 3}):
        (run.folder / "result.json").write_text(json.dumps(spoilt))
        with pytest.raises(ValueError, match=r"Expected the record of a finished run in .*result"):
            _ = Run(run.folder).result


def test_only_finished_runs_are_found(tmp_path: Path, result_of) -> None:
    done, begun = Run(tmp_path / "esim-1" / "a-seed0"), Run(tmp_path / "esim-1" / "a-seed1")
    begun.save_config(OmegaConf.create({"seed": 1}), {"recipe.epochs": 3})
    done.finish(result_of("esim"))
    assert [run.folder for run in finished_runs(tmp_path)] == [done.folder]
    assert begun.config().seed == 1
    assert begun.recipe() == {"recipe.epochs": 3}
    assert done.recipe() == {}
    assert not begun.finished


def test_settings_of_one_simulator_keep_their_labels() -> None:
    systems = [("esim", "esim-1"), ("v2e", "v2e-1"), ("v2e", "v2e-2"), ("v2e", "v2e-2")]
    names = short_names(systems)
    assert names == {"esim-1": "esim", "v2e-1": "v2e-1", "v2e-2": "v2e-2"}


def test_settings_are_told_by_what_they_see_where_that_differs() -> None:
    systems = [("esim", "esim-1"), ("v2e", "v2e-1"), ("v2e", "v2e-2"), ("v2e", "v2e-3")]
    settings = {"esim-1": "display", "v2e-1": "srgb", "v2e-2": "display", "v2e-3": "display"}
    names = short_names(systems, settings, marked={"esim-1", "v2e-2"})
    assert names == {
        "esim-1": "esim†", "v2e-1": "v2e srgb", "v2e-2": "v2e-2†", "v2e-3": "v2e-3"
    }  # fmt: skip


def test_a_resumed_phase_adds_to_its_time(tmp_path: Path) -> None:
    times = PhaseTimes(tmp_path / "timings")
    (tmp_path / "timings").mkdir()
    (tmp_path / "timings/train.json").write_text('{"phase": "train", "seconds": 100.0, "begun": 1}')
    with times.measure("train", resumed=True):
        pass
    with times.measure("report"):
        pass
    assert times.read()["train"] >= 100.0
    assert list(times.read()) == ["train", "report"]


def test_a_mistake_ends_in_one_sentence(caplog: pytest.LogCaptureFixture) -> None:
    @explained
    def command(cfg: DictConfig) -> None:
        instantiate(cfg.sim)

    with caplog.at_level(logging.ERROR), pytest.raises(SystemExit) as stopped:
        command(composed("sim.threshold_on_log=-1"))
    assert stopped.value.code == 1
    (record,) = caplog.records
    assert "sim.threshold_on_log" in record.message
    assert "\n" not in record.message
