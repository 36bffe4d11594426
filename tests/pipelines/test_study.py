"""The whole chain through the real configuration, on a world of a few tiny sequences."""

import json
import re
import runpy
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate
from lightning.pytorch.callbacks import Callback
from omegaconf import DictConfig, open_dict
from PIL import Image
from torch.utils.data import DataLoader

import eqs
from eqs.data import RecordedEvents
from eqs.metrics import Definition, Judge
from eqs.pipelines.build import dataset
from eqs.pipelines.detections import detections_over
from eqs.pipelines.evaluate import evaluate
from eqs.pipelines.judge import KEPT_TAPS
from eqs.pipelines.resolvers import register_resolvers
from eqs.pipelines.result import RunResult
from eqs.pipelines.reverse import reverse_precision
from eqs.pipelines.runs import Run, finished_runs
from eqs.pipelines.scoring import find_scoring
from eqs.pipelines.train import build_task, train
from eqs.training import Binning, EvaluationDataset, WindowSource

CONFIGS = Path(eqs.__file__).parent / "configs"
README = Path(__file__).parents[2] / "README.md"


class Interrupted(Exception):
    """Stands for a power cut."""


class PowerCut(Callback):
    """Stops the training in the middle of its second epoch."""

    def on_train_batch_end(self, trainer, *_):
        if trainer.global_step == 3:
            raise Interrupted


class PowerCutBetween(Callback):
    """Stops the training between its two epochs."""

    def on_train_epoch_start(self, trainer, *_):
        if trainer.current_epoch == 1:
            raise Interrupted


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("study")


def configured(place: Path, *overrides: str, name: str = "train") -> DictConfig:
    register_resolvers()
    paths = [f"paths.{key}={place / key}" for key in ("datasets", "simulated", "runs", "results")]
    small = [
        "experiment=smoke",
        "data.size=64x48",
        "data.generator.frames=8",
        "data.generator.sequences={train: 2, val: 1, test: 2}",
        "+data.generator.workers=1",
        "recipe.steps_per_epoch=2",
        "recipe.validate_every_epochs=1",
        "task.confidence_threshold=1e-5",  # what has hardly learnt anything is not sure of it
    ]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose(name, overrides=[*small, *paths, *overrides])
    with open_dict(cfg):
        cfg.callbacks = {}
    return cfg


def runs_of(place: Path) -> list[Run]:
    return list(finished_runs(place / "runs/dsec_mini_smoke"))


@pytest.fixture(scope="module")
def trained(place: Path) -> dict[str, RunResult]:
    return {name: train(configured(place, f"sim={name}")) for name in ("real", "esim")}


@pytest.mark.slow
def test_a_run_reports_both_test_streams(trained: dict[str, RunResult]) -> None:
    esim, real = trained["esim"], trained["real"]
    assert set(esim.own.map_per_class) == {"pedestrian", "two_wheeler", "car"}
    assert esim.own.ground_truths_per_class == real.real.ground_truths_per_class
    assert real.own == real.real
    assert esim.recipe == real.recipe
    assert esim.system != "esim"


@pytest.mark.slow
def test_a_finished_run_is_not_repeated(place: Path, trained: dict[str, RunResult]) -> None:
    def stamps() -> list[int]:
        runs = finished_runs(place / "runs/dsec_mini_smoke")
        return [run.weights.stat().st_mtime_ns for run in runs]

    checkpoints = {path.name for path in (place / "runs").rglob("*.ckpt")}
    assert checkpoints == {"best.ckpt", "last.ckpt", "weights.ckpt"}
    before = stamps()
    assert train(configured(place, "sim=esim")) == trained["esim"]
    assert stamps() == before


@pytest.mark.slow
@pytest.mark.parametrize("kind", [PowerCut, PowerCutBetween])
def test_an_interrupted_run_ends_with_the_same_numbers(
    place: Path, trained: dict[str, RunResult], kind: type[Callback]
) -> None:
    elsewhere = [f"paths.runs={place / kind.__name__}", "sim=esim"]
    elsewhere += ["recipe.validate_every_epochs=2"]  # when it validates may change nothing
    cut, again = (configured(place, *elsewhere) for _ in range(2))
    with open_dict(cut), open_dict(again):
        cut.callbacks = {"progress": {"_target_": f"{__name__}.{kind.__name__}"}}
        again.callbacks = {"progress": {"_target_": "eqs.training.EpochLines", "label": "esim"}}
    with pytest.raises(Interrupted):
        train(cut)
    assert not list(finished_runs(place / kind.__name__ / "dsec_mini_smoke"))
    assert len(list((place / kind.__name__).rglob("last.ckpt"))) == 1
    result = train(again)
    assert (result.own, result.real) == (trained["esim"].own, trained["esim"].real)


@pytest.mark.slow
def test_a_refused_overwrite_keeps_the_old_run(
    place: Path, trained: dict[str, RunResult], caplog: pytest.LogCaptureFixture
) -> None:
    with pytest.raises(SystemExit):
        train(configured(place, "sim=esim", "overwrite=true", "ckpt_path=nowhere.ckpt"))
    assert "Expected a checkpoint at nowhere.ckpt" in caplog.text
    with pytest.raises(SystemExit):
        train(configured(place, "sim=esim", "overwrite=true", "recipe.learning_rate=abc"))
    assert len(list(finished_runs(place / "runs/dsec_mini_smoke"))) == len(trained)


@pytest.mark.slow
def test_detections_are_filmed(
    place: Path, trained: dict[str, RunResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    run = next(finished_runs(place / "runs/dsec_mini_smoke")).folder
    recording = next((place / "datasets").glob("*/test/*"))
    out = place / "film.gif"
    monkeypatch.setattr(
        "sys.argv", ["watch.py", str(run), str(recording), str(out), "--min-score", "0"]
    )
    runpy.run_path(str(README.parent / "scripts" / "watch.py"), run_name="__main__")
    with Image.open(out) as film:
        assert (film.width, film.height) == (4 * 64, 4 * 48)
        film.seek(film.n_frames - 1)
        colours = {tuple(colour) for _, colour in film.convert("RGB").getcolors(100_000)}
    assert len(colours) > 3  # white, both polarities, and boxes


@pytest.mark.slow
@pytest.mark.parametrize("protocol", ["coco", "prophesee_gen1"])
def test_films_show_the_detections_that_enter_the_mAP(
    place: Path, trained: dict[str, RunResult], protocol: str
) -> None:
    (run,) = (run for run in runs_of(place) if run.result.simulator == "real")
    cfg = configured(place, f"protocol={protocol}", "model.num_classes=3")
    rule = instantiate(cfg.protocol)
    recording = dataset(cfg).recordings("test")[0]
    filmed = list(detections_over(run, recording, recording.events_path, rule))
    task = build_task(cfg, rule, ["real"]).eval()
    weights = torch.load(run.weights, weights_only=True)["state_dict"]
    task.load_state_dict({k: v for k, v in weights.items() if k.startswith("model.")}, strict=False)
    source = WindowSource(
        recording=recording, events_path=recording.events_path, protocol=rule, binning=Binning()
    )
    counted = []
    with torch.no_grad():
        for chunk in DataLoader(EvaluationDataset([source], chunk_length=4), batch_size=None):
            everywhere = torch.ones_like(chunk["labelled"])
            counted += task.detect({**chunk, "labelled": everywhere})
    assert len(filmed) == len(counted) == len(recording.frame_times_us) - 1
    assert sum(len(boxes.labels) for boxes in filmed) > 0
    for boxes, found in zip(filmed, counted, strict=True):
        np.testing.assert_allclose(boxes.scores, found["scores"], atol=1e-5)
        np.testing.assert_allclose(boxes.corners, found["boxes"], atol=1e-2)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*LeafSpec.*:FutureWarning", "ignore:.*many workers")
def test_the_reverse_mAP_of_real_events_is_the_forward_one(
    place: Path, trained: dict[str, RunResult]
) -> None:
    runs = {run.result.simulator: run for run in finished_runs(place / "runs/dsec_mini_smoke")}
    data = dataset(configured(place, name="evaluate"))
    found = reverse_precision(runs["real"], data, {"again": RecordedEvents()})
    assert found == {"again": trained["real"].real.map}


@pytest.mark.slow
def test_training_on_real_events_leaves_a_judge(place: Path, trained: dict[str, RunResult]) -> None:
    folders = {run.result.simulator: run.folder for run in runs_of(place)}
    assert not (folders["esim"] / "judge.json").exists()
    judge = Judge.load(folders["real"])
    assert judge.definition == Definition(architecture="rvt-tiny-split1")
    assert {centre.tap for centre in judge.centres} == set(KEPT_TAPS)
    seen = "a rendered world seen by reference_sensor (51f1ba55d567)"
    assert judge.description.endswith(f"of dsec_mini_smoke, {seen}")
    (folders["real"] / "judge.json").unlink()  # as older runs have none
    again = find_scoring(configured(place, name="evaluate"), None).judge
    assert [c.sha256 for c in again.centres] == [c.sha256 for c in judge.centres]


@pytest.mark.slow
@pytest.mark.parametrize("reading", ["eqs", "eqs_paper"])
def test_the_readme_s_snippet_gives_the_study_s_row(
    place: Path,
    trained: dict[str, RunResult],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    reading: str,
) -> None:
    cfg = configured(place, "score=true", f"metric={reading}", name="evaluate")
    evaluate(cfg)
    rows = pd.read_csv(place / "results/dsec_mini_smoke/eqs.csv").query("system == 'esim'")
    (run,) = (run for run in runs_of(place) if run.result.simulator == "real")
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
    (snippet,) = (block for block in blocks if "EventQualityScore" in block)
    if reading == "eqs_paper":
        snippet = snippet.replace('Score("judge")', f'Score("judge", tap="gate", **{PAPER})')
    monkeypatch.chdir(tmp_path)
    Path("judge").symlink_to(run.folder)
    for recording in dataset(cfg).recordings("test"):
        shutil.copy(recording.events_path, "events.h5")
        count = len(recording.frame_times_us)
        frames = np.stack([recording.read_frame(index) for index in range(count)])
        made = {"frames": frames, "timestamps_us": recording.frame_times_us}
        exec(snippet, made)
        expected = rows.set_index("sequence").loc[recording.name, "eqs"]
        assert made["score"].compute().item() == pytest.approx(expected, abs=1e-6)
        assert f"tensor({made['score'].compute():.4f}" in capsys.readouterr().out


PAPER = {"features": "raw", "distance": "cosine", "patch_size": 3}


@pytest.mark.slow
def test_the_study_is_written_down(place: Path, trained: dict[str, RunResult]) -> None:
    evaluate(configured(place, "score=true", "eqs.warmup_windows=1", name="evaluate"))
    results = place / "results/dsec_mini_smoke"
    study, scores = pd.read_csv(results / "study.csv"), pd.read_csv(results / "eqs.csv")
    assert sorted(study["simulator"]) == ["esim", "real"]
    assert sorted(set(scores["simulator"])) == ["esim", "pix2nvs", "v2e"]
    assert len(scores) == 3 * 2
    assert scores["eqs"].between(-1, 1).all()
    assert scores["eqs"].equals(scores["eqs_hidden_silence"])
    rivals = {f"baseline_{name}" for name in ("untrained_eqs", "frechet_distance")}
    assert rivals < set(study) & set(scores)
    assert study.set_index("simulator")["baseline_reverse_map"].notna()["esim"]
    assert scores["weights_sha256"].nunique() == scores["definition"].nunique() == 1
    anchors = pd.read_csv(results / "anchors.csv").set_index("anchor")
    assert (anchors.filter(like="eqs_").loc["identical"] - 1).abs().max() < 1e-6
    assert (anchors["sequences"] == 2).all()
    assert (scores["stop_us"] - scores["start_us"] == 7 * 50_000).all()
    assert json.loads((results / "correlation.json").read_text())["results"]
    report = (results / "report.html").read_text()
    assert str(place) not in report
    assert "Few windows" not in report  # six count, after a warm-up of one
    assert "reference sensor" in report
    assert "http" not in report.replace("http://www.w3.org", "")
