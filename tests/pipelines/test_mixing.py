"""Trainings on several kinds of events, at once or one after the other, from command to table."""

from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
import torch
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate
from lightning.pytorch.callbacks import Callback
from omegaconf import DictConfig, OmegaConf, open_dict

import eqs
from eqs.data import RecordedEvents
from eqs.pipelines.build import dataset, event_source
from eqs.pipelines.comparable import comparable_runs
from eqs.pipelines.evaluate import evaluate, scored_systems, study_rows
from eqs.pipelines.judge import trained_on_real
from eqs.pipelines.recipe import WEIGHTS, recipe, recipe_hash
from eqs.pipelines.resolvers import register_resolvers
from eqs.pipelines.result import RunResult
from eqs.pipelines.runs import Run
from eqs.pipelines.start import start_of, trained_as
from eqs.pipelines.train import Job, streams_to_test, train

CONFIGS = Path(eqs.__file__).parent / "configs"
ALONE = "sim.streams.simulated.share=0"
HALF = "sim.streams.real.share=0.5"


class Cut(Callback):
    """Ctrl-C in the second epoch."""

    def on_train_batch_end(self, trainer, *_):
        if trainer.global_step == trainer.num_training_batches + 1:
            raise KeyboardInterrupt


def configured(place: Path, *overrides: str, name: str = "train") -> DictConfig:
    register_resolvers()
    paths = [f"paths.{key}={place / key}" for key in ("datasets", "simulated", "runs", "results")]
    small = [
        "experiment=smoke",
        "data.size=32x32",
        "data.generator.frames=5",
        "data.generator.sequences={train: 4, val: 1, test: 1}",
        "+data.generator.workers=1",
        "recipe.steps_per_epoch=2",
        "recipe.sequence_length=2",
        "protocol.min_side_px=0",
        "protocol.min_diagonal_px=0",
        "task.confidence_threshold=0.5",
    ]
    small += ["logger=csv"] if name == "train" else []
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose(name, overrides=[*small, *paths, *overrides])
    with open_dict(cfg):
        cfg.callbacks = {}
    return cfg


def job(cfg: DictConfig) -> Job:
    return Job.of(cfg, event_source(cfg.sim, cfg), dataset(cfg), instantiate(cfg.protocol))


def weights(cfg: DictConfig) -> list[torch.Tensor]:
    return list(torch.load(job(cfg).run.weights, weights_only=True)["state_dict"].values())


def equal(one: DictConfig, other: DictConfig) -> bool:
    pairs = zip(weights(one), weights(other), strict=True)
    return all(torch.equal(first, second) for first, second in pairs)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("mixing")


@pytest.fixture(scope="module")
def trained(place: Path) -> dict[str, DictConfig]:
    """A study of mixing, every training of it finished."""
    cfgs = {
        "real": configured(place, "sim=real"),
        "esim": configured(place, "sim=esim"),
        "half": configured(place, "sim=mix", ALONE, HALF),
        "both": configured(place, "sim=mix", HALF),
    }
    for cfg in cfgs.values():
        assert train(cfg) is not None
    start = f"model.weights={job(cfgs['esim']).run.folder}"
    cfgs["then"] = configured(place, "sim=mix", ALONE, HALF, start)
    cfgs["after"] = configured(place, "sim=real", start)
    for name in ("then", "after"):
        assert train(cfgs[name]) is not None
    return cfgs


def result(cfg: DictConfig) -> RunResult:
    return job(cfg).run.result


@pytest.mark.slow
def test_a_mix_of_one_stream_whole_trains_the_detector_of_that_stream(
    place: Path, trained: dict[str, DictConfig], tmp_path: Path
) -> None:
    whole = configured(place, "sim=mix", ALONE, f"paths.runs={tmp_path}")
    assert train(whole) is not None
    assert equal(whole, trained["real"])
    assert result(whole).real == result(trained["real"]).real
    assert result(whole).simulator == "mix_real100"
    assert not equal(trained["half"], trained["real"])


@pytest.mark.slow
def test_a_mix_that_was_cut_goes_on_and_ends_the_same(
    place: Path, trained: dict[str, DictConfig], tmp_path: Path
) -> None:
    again = configured(place, "sim=mix", HALF, f"paths.runs={tmp_path}")
    cut = again.copy()
    with open_dict(cut):
        cut.callbacks = {"progress": {"_target_": f"{__name__}.Cut"}}
    with pytest.raises(SystemExit):
        train(cut)
    assert job(again).run.last_checkpoint.is_file()
    train(again)
    assert equal(again, trained["both"])
    assert not equal(again, trained["half"])


@pytest.mark.slow
def test_a_mix_is_trained_on_the_union_and_evaluated_on_one_stream(
    trained: dict[str, DictConfig],
) -> None:
    done = job(trained["both"])
    module = instantiate(done.cfg.datamodule)(
        dataset=done.data, protocol=done.protocol, source=done.source, tests={}
    )
    found = [source.events_path for source in module.training_dataset().sources]
    real = {recording.events_path for recording in done.data.recordings("train")}
    assert len(found) == len(set(found)) == 6
    assert len(real & {*found}) == 2
    (val,) = module.evaluation_dataset("val", done.source).sources
    assert "esim-" in str(val.events_path)


@pytest.mark.slow
def test_the_results_say_what_was_seen(trained: dict[str, DictConfig]) -> None:
    found = {name: result(cfg) for name, cfg in trained.items()}
    assert {name: (each.simulator, each.trained_on) for name, each in found.items()} == {
        "real": ("real", "real"),
        "esim": ("esim", "esim"),
        "half": ("mix_real50", "real 50 %"),
        "both": ("mix_esim100_real50", "esim 100 % + real 50 %"),
        "then": ("esim_then_mix_real50", "esim then real 50 %"),
        "after": ("esim_then_real", "esim then real"),
    }
    assert {name for name, each in found.items() if each.plain} == {"real", "esim"}
    assert len({each.system for each in found.values()}) == len(found)


@pytest.mark.slow
def test_the_weights_of_a_run_are_those_of_its_folder(
    place: Path, trained: dict[str, DictConfig]
) -> None:
    run = job(trained["esim"]).run
    start = f"model.weights={run.weights}"
    assert job(configured(place, "sim=real", start)).run == job(trained["after"]).run
    assert not equal(trained["after"], trained["real"])
    checkpoint = f"model.weights={run.last_checkpoint}"
    found = start_of(configured(place, "sim=real", checkpoint))
    assert found is not None
    assert (found.name, found.stages) == ("esim", ({"esim": 1.0},))


@pytest.mark.slow
def test_weights_that_lie_elsewhere_are_still_somebody_s(
    place: Path, trained: dict[str, DictConfig], tmp_path: Path
) -> None:
    copied = tmp_path / "copied.ckpt"
    copied.write_bytes(job(trained["esim"]).run.weights.read_bytes())
    cfg = configured(place, "sim=real", f"model.weights={copied}")
    assert trained_as(RecordedEvents(), start_of(cfg))["simulator"] == "weights_then_real"
    content = torch.load(copied, weights_only=True)
    torch.save({"state_dict": content["state_dict"]}, copied)  # as others publish theirs
    assert start_of(cfg) is None
    assert trained_as(RecordedEvents(), None)["simulator"] == "real"


@pytest.mark.slow
def test_only_who_saw_real_events_alone_and_all_of_them_judges(
    place: Path, trained: dict[str, DictConfig]
) -> None:
    cfg = configured(place, name="evaluate")
    assert [run.folder for run in trained_on_real(cfg)] == [job(trained["real"]).run.folder]
    judges = {path.parent for path in (place / "runs").rglob("judge.json")}
    assert judges == {job(trained["real"]).run.folder}


@pytest.mark.slow
def test_an_evaluation_tabulates_and_draws_them(
    place: Path, trained: dict[str, DictConfig]
) -> None:
    evaluate(configured(place, name="evaluate"))
    results = place / "results/dsec_mini_smoke"
    table = pd.read_csv(results / "accuracy.csv", keep_default_na=False).set_index("system")
    assert set(table["trained_on"]) == {result(cfg).trained_on for cfg in trained.values()}
    assert table["real_share"].to_dict() == {
        "esim": 0.0, "mix_real50": 0.5, "mix_esim100_real50": 0.5, "esim_then_mix_real50": 0.5,
        "esim_then_real": 1.0, "real": 1.0,
    }  # fmt: skip
    assert table.loc["mix_esim100_real50", ["beside", "before"]].tolist() == ["esim", ""]
    assert table.loc["esim_then_mix_real50", ["beside", "before"]].tolist() == ["", "esim"]
    assert (results / "figures/mixing.png").is_file()


def run_of(place: Path, name: str, found: RunResult, settings: dict[str, object]) -> Run:
    run = Run(place / name)
    run.save_config(OmegaConf.create({"sim": {"_target_": "eqs.data.RecordedEvents"}}), settings)
    run.finish(found)
    return run


def test_a_run_that_started_from_another_may_differ_in_its_weights_alone(
    tmp_path: Path, result_of, monkeypatch: pytest.MonkeyPatch
) -> None:
    cfg = configured(tmp_path, name="evaluate")
    content = "here"
    monkeypatch.setattr("eqs.pipelines.comparable.dataset", lambda cfg: None)
    monkeypatch.setattr("eqs.pipelines.comparable.data_hash", lambda data: content)
    plain = {**recipe(cfg), "seed": 0}
    stages = ({"esim": 1.0}, {"real": 1.0})
    other = result_of("esim_then_real", data=content, stages=stages)
    started = {**plain, WEIGHTS: "of esim"}
    runs = {
        "same": (result_of("real", data=content, recipe=recipe_hash(cfg)), plain),
        "started": (other, started),
        "published": (result_of("real", data=content), started),
        "longer": (other, {**started, "recipe.epochs": 99}),
        "elsewhere": (replace(other, data="there"), started),
    }
    found = [run_of(tmp_path, name, *each) for name, each in runs.items()]
    assert [run.folder.name for run in comparable_runs(cfg, found)] == ["same", "started"]


def test_what_is_no_simulator_is_not_scored(tmp_path: Path, result_of) -> None:
    cfg = configured(tmp_path, name="evaluate")
    stages = {"esim_then_real": ({"esim": 1.0}, {"real": 1.0}), "mix_esim50": ({"esim": 0.5},)}
    runs = [
        run_of(tmp_path, name, result_of(name, stages=each), {}) for name, each in stages.items()
    ]
    assert set(scored_systems(cfg, runs)) == {"esim", "v2e", "pix2nvs"}
    (first, second) = study_rows(runs)
    assert (first["trained_on"], second["real_share"]) == ("esim then real", 0.0)
    mixed = configured(tmp_path, "+sim@simulators.mine=mix", name="evaluate")
    with pytest.raises(ValueError, match="Expected simulators to score, got a mix"):
        scored_systems(mixed, [])


def test_both_tests_are_one_where_the_own_events_are_the_real_ones(tmp_path: Path) -> None:
    def streams(*overrides: str) -> list[str]:
        cfg = configured(tmp_path, *overrides)
        return list(streams_to_test(event_source(cfg.sim, cfg)))

    assert streams("sim=mix") == streams("sim=esim") == ["own", "real"]
    assert streams("sim=mix", "sim.evaluated_on=real") == streams("sim=real") == ["real"]
    assert streams("sim=mix", ALONE, HALF) == ["real"]


def test_a_folder_without_weights_is_named(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    with pytest.raises(FileNotFoundError, match=r"start from at .*run/weights.ckpt, found none"):
        recipe(configured(tmp_path, f"model.weights={tmp_path / 'run'}"))


def test_records_of_before_say_nothing_of_stages_and_are_read(tmp_path: Path, result_of) -> None:
    run = run_of(tmp_path, "old", result_of("esim"), {})
    path = run.folder / "result.json"
    text = path.read_text()
    path.write_text(text[: text.index(',\n  "stages"')] + "\n}\n")
    assert Run(run.folder).result == result_of("esim")
