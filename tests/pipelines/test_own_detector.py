"""A detector that is not RVT, the one of the documents: trained, resumed, tabulated, loaded."""

import logging
import re
from pathlib import Path

import pandas as pd
import pytest
import torch
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate
from lightning.pytorch.callbacks import Callback
from omegaconf import DictConfig, open_dict

import eqs
from eqs.metrics import weights_sha256
from eqs.models import Geometry, load_detector
from eqs.pipelines.build import dataset
from eqs.pipelines.detections import detections_over
from eqs.pipelines.evaluate import evaluate
from eqs.pipelines.resolvers import register_resolvers
from eqs.pipelines.runs import Run, finished_runs
from eqs.pipelines.scoring import find_scoring
from eqs.pipelines.train import build_task, train

CONFIGS = Path(eqs.__file__).parent / "configs"
PAGE = Path(__file__).parents[2] / "docs" / "detector.md"
STEPS = 40
WITH_TAPS = """
from my_detector import CellDetector


class Shown(CellDetector):
    in_channels, strides, tap_names = 20, (8,), ("memory",)

    def taps(self, x, states, *, stages, names):
        maps, states = self.forward_sequence(x, states)
        return {name: maps for name in names}, states
"""


class Interrupted(Exception):
    """Stands for a power cut."""


class PowerCut(Callback):
    """Stops the training in the middle of its second epoch."""

    def on_train_batch_end(self, trainer, *_):
        if trainer.global_step == STEPS // 2 + 1:
            raise Interrupted


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("own")


@pytest.fixture(scope="module", autouse=True)
def written(place: Path):
    """The page's code as a module, its settings as a choice."""
    section = PAGE.read_text().partition("## A detector of your own")[2].partition("\n## ")[0]
    (code,) = re.findall(r"```python\n(.*?)```", section, re.DOTALL)
    (settings,) = re.findall(r"```yaml\n(.*?)```", section, re.DOTALL)
    (place / "my_detector.py").write_text(code)
    (place / "my_taps.py").write_text(WITH_TAPS)
    (place / "my_configs" / "model").mkdir(parents=True)
    (place / "my_configs" / "model" / "cells.yaml").write_text(settings)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(place))
        yield


def configured(place: Path, *overrides: str, name: str = "train") -> DictConfig:
    register_resolvers()
    paths = [f"paths.{key}={place / key}" for key in ("datasets", "simulated", "runs", "results")]
    small = [
        f"hydra.searchpath=[file://{place / 'my_configs'}]",
        "data=dsec_mini_smoke",
        "model=cells",
        "data.size=64x48",
        "data.generator.frames=8",
        "data.generator.sequences={train: 2, val: 1, test: 2}",
        "+data.generator.workers=1",
        f"recipe.steps_per_epoch={STEPS // 2}",
        "recipe.validate_every_epochs=1",
        "recipe.learning_rate=1e-2",
        "task.confidence_threshold=1e-5",
    ]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose(name, overrides=[*small, *paths, *overrides])
    with open_dict(cfg):
        cfg.callbacks = {}
    return cfg


def losses(run: Run) -> list[float]:
    (curve,) = run.folder.rglob("metrics.csv")
    return pd.read_csv(curve)["train/loss"].dropna().tolist()


@pytest.fixture(scope="module")
def trained(place: Path) -> dict[bool, Run]:
    """Trained without a break, with states and without."""
    runs = {}
    for recurrent in (True, False):
        overrides = ["logger=csv", "trainer.log_every_n_steps=1"]
        cfg = configured(place, "sim=real", f"model.recurrent={recurrent}", *overrides)
        assert train(cfg) is not None
        (runs[recurrent],) = set(finished_runs(place / "runs/dsec_mini_smoke")) - {*runs.values()}
    return runs


@pytest.mark.slow
@pytest.mark.parametrize("recurrent", [True, False])
def test_it_learns(trained: dict[bool, Run], recurrent: bool) -> None:
    found = losses(trained[recurrent])
    assert len(found) == STEPS
    assert sum(found[-3:]) < 0.7 * sum(found[:3])


@pytest.mark.slow
@pytest.mark.parametrize("recurrent", [True, False])
def test_an_interrupted_training_ends_with_the_same_numbers(
    place: Path, trained: dict[bool, Run], recurrent: bool
) -> None:
    elsewhere = [f"paths.runs={place / f'cut-{recurrent}'}", f"model.recurrent={recurrent}"]
    cut, again = (configured(place, "sim=real", *elsewhere) for _ in range(2))
    with open_dict(cut):
        cut.callbacks = {"progress": {"_target_": f"{__name__}.PowerCut"}}
    with pytest.raises(Interrupted):
        train(cut)
    result = train(again)
    before = trained[recurrent].result
    assert (result.own, result.real, result.recipe) == (before.own, before.real, before.recipe)
    (run,) = finished_runs(place / f"cut-{recurrent}/dsec_mini_smoke")
    one, other = (load_detector(each.weights).state_dict() for each in (run, trained[recurrent]))
    assert all(torch.equal(one[name], other[name]) for name in one)


@pytest.mark.slow
def test_its_runs_are_tabulated_apart(
    place: Path, trained: dict[bool, Run], caplog: pytest.LogCaptureFixture
) -> None:
    evaluate(configured(place, name="evaluate"))
    table = pd.read_csv(place / "results/dsec_mini_smoke/accuracy.csv")
    assert table["recipe"].tolist() == [trained[True].result.recipe]
    assert table["map_real"].tolist() == [trained[True].result.real.map]
    with caplog.at_level(logging.INFO), pytest.raises(SystemExit):
        evaluate(configured(place, "model=rvt_tiny", name="evaluate"))
    assert f"left out {trained[True].folder}: model._target_ my_detector.Cell" in caplog.text
    assert "Expected a finished run on dsec_mini_smoke with this recipe" in caplog.text


@pytest.mark.slow
def test_without_taps_it_is_no_judge(
    place: Path, trained: dict[bool, Run], caplog: pytest.LogCaptureFixture
) -> None:
    assert not list((place / "runs").rglob("judge.json"))
    with caplog.at_level(logging.INFO):
        train(configured(place, "sim=real", "recipe.steps_per_epoch=1", "seed=1"))
    assert "no judge is written: the network CellDetector has no taps" in caplog.text
    with caplog.at_level(logging.INFO):
        evaluate(configured(place, "score=true", name="evaluate"))
    assert "judge: varied, which comes with the package" in caplog.text


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*LeafSpec.*:FutureWarning")
@pytest.mark.parametrize("recurrent", [True, False])
def test_its_checkpoint_is_the_detector_that_was_tested(
    place: Path, trained: dict[bool, Run], recurrent: bool
) -> None:
    run = trained[recurrent]
    detector, cfg = load_detector(run.weights), run.config()
    assert detector.geometry == Geometry(
        height=48, width=64, bins=10, window_us=50_000, count_cutoff=10,
        class_names=("pedestrian", "two_wheeler", "car"),
    )  # fmt: skip
    assert detector.model.recurrent is recurrent
    protocol = instantiate(cfg.protocol)
    task = build_task(cfg, protocol, ["real"]).eval()
    weights = torch.load(run.weights, weights_only=True)["state_dict"]
    task.load_state_dict({k: v for k, v in weights.items() if k.startswith("model.")}, strict=False)
    generator = torch.Generator().manual_seed(0)
    windows = torch.randint(0, 4, (3, 1, 20, 48, 64), generator=generator).float()
    maps, _ = task.model.forward_sequence(windows, None)
    expected, states = task.model.detect([each.flatten(0, 1) for each in maps]), detector.start()
    for window, frame in zip(windows, expected, strict=True):
        predictions, states = detector(window, states)
        torch.testing.assert_close(predictions[0], frame, rtol=1e-4, atol=1e-4)
    (window,) = windows[:1]
    program = torch.export.export(detector, (window, detector.start()))
    for found, wanted in zip(
        program.module()(window, detector.start()), detector(window, detector.start()), strict=True
    ):
        torch.testing.assert_close(found, wanted, rtol=0, atol=1e-5)
    recording = dataset(cfg).recordings("test")[0]
    found = list(detections_over(run, recording, recording.events_path, protocol))
    assert sum(len(boxes.labels) for boxes in found) > 0


@pytest.mark.slow
def test_with_taps_it_is_the_judge_of_its_world(place: Path) -> None:
    there = [f"paths.runs={place / 'shown'}", "model._target_=my_taps.Shown"]
    train(configured(place, "sim=real", "recipe.steps_per_epoch=2", *there))
    (run,) = finished_runs(place / "shown/dsec_mini_smoke")
    cfg = configured(place, f"paths.runs={place / 'shown'}", name="evaluate")
    found = find_scoring(cfg, dataset(cfg))
    names = [reading.name for reading in found.readings]
    assert names == ["memory_silence", "memory_centred", "memory_raw"]
    assert found.judge.description.startswith("Shown trained on the recorded events of dsec_mini")
    weights = load_detector(run.weights).model
    assert found.judge.weights_sha256 == weights_sha256(weights)
    assert found.judge.untrained().weights_sha256 != found.judge.weights_sha256
    (run.folder / "judge.json").unlink()
    again = find_scoring(cfg, dataset(cfg)).headline
    assert again.definition == found.headline.definition
    assert again.centre is None


@pytest.mark.parametrize(
    ("override", "sentence"),
    [
        ("compile=true", "detector with compile_stages, got a CellDetector without; set compile"),
        ("model._target_=my_detector.Gone", "class that can be imported as my_detector.Gone"),
        ("model._target_=torch.nn.Identity", "got a Identity without forward_sequence, loss"),
        ("+model.depth=3", "settings that my_detector.CellDetector takes"),
    ],
)
def test_what_is_no_detector_is_refused_before_the_work(
    place: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture, override: str, sentence: str
) -> None:
    with pytest.raises(SystemExit):
        train(configured(place, "sim=real", f"paths.datasets={tmp_path}", override))
    assert sentence in caplog.messages[-1]
    assert list(tmp_path.iterdir()) == []
