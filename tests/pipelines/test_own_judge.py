"""A judge that is no RVT, the one of the documents: two files, a study, what it leaves."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from hydra import compose, initialize_config_dir
from omegaconf import DictConfig

import eqs
from eqs.events import Events
from eqs.metrics import EventQualityScore, Judge
from eqs.metrics.windows import histogram_chunks
from eqs.pipelines.build import dataset
from eqs.pipelines.evaluate import evaluate
from eqs.pipelines.resolvers import register_resolvers
from eqs.pipelines.score_files import score_files
from eqs.pipelines.scoring import find_scoring

CONFIGS = Path(eqs.__file__).parent / "configs"
PAGE = Path(__file__).parents[2] / "docs" / "detector.md"


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("own")


@pytest.fixture(scope="module", autouse=True)
def written(place: Path):
    """The page's code as a module, its settings as a choice."""
    section = PAGE.read_text().partition("## A judge of your own")[2].partition("\n## ")[0]
    (code,) = re.findall(r"```python\n(.*?)```", section, re.DOTALL)
    (settings,) = re.findall(r"```yaml\n(.*?)```", section, re.DOTALL)
    (place / "my_judge.py").write_text(code)
    (place / "my_configs" / "metric").mkdir(parents=True)
    (place / "my_configs" / "metric" / "stages.yaml").write_text(settings)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(place))
        yield


def configured(place: Path, name: str, *overrides: str) -> DictConfig:
    register_resolvers()
    paths = [f"paths.{key}={place / key}" for key in ("datasets", "simulated", "runs", "results")]
    own = [f"hydra.searchpath=[file://{place / 'my_configs'}]", "metric=stages", "device=cpu"]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        return compose(name, overrides=[*own, *paths, *overrides])


def files(place: Path, make_events) -> tuple[Events, Events]:
    both = make_events(6000, 37, 50), make_events(6000, 37, 50, seed=1)
    for name, events in zip(("real", "simulated"), both, strict=True):
        replace(events, span_us=(0, 1_000_000)).save(place / f"{name}.h5")
    return both


def score(place: Path, out: str, *overrides: str) -> dict:
    pair = [f"simulated={place / 'simulated.h5'}", f"real={place / 'real.h5'}"]
    score_files(configured(place, "score", *pair, f"out={place / out}", *overrides))
    return json.loads((place / out / "score.json").read_text())


def test_two_files_are_scored_by_its_first_tap(place: Path, make_events) -> None:
    real, simulated = files(place, make_events)
    record = score(place, "scores")
    names = {f"{tap}_{features}" for tap in ("memory", "now") for features in ("silence", "raw")}
    assert set(record["readings"]) == names
    network = Judge.built({"_target_": "my_judge.RandomStages", "width": 16}).backbone
    definition = EventQualityScore(Judge.of(network)).definition
    starts = np.arange(20) * definition.window_us
    (histograms,) = histogram_chunks([real, simulated], starts, definition, chunk_windows=20)
    maps, _ = network.taps(histograms.float(), None, stages=(1, 2, 3), names=("memory",))
    expected = [mean_cosine(each[5:], count=3) for each in maps["memory"]]
    assert record["readings"]["memory_raw"] == pytest.approx(np.mean(expected), abs=1e-5)
    assert record["eqs"] == record["readings"]["memory_silence"] < 1


def mean_cosine(maps: torch.Tensor, count: int) -> float:
    """The mean over patches of the cosine of both streams, patch by patch."""
    rows, columns = maps.shape[-2:]
    found = []
    for row in range(0, rows, count):
        for column in range(0, columns, count):
            patch = maps[..., row : row + count, column : column + count].mean((-2, -1))
            found.append(torch.cosine_similarity(patch[:, 0], patch[:, 1], dim=-1))
    return float(torch.stack(found).mean())


def test_settings_make_another_judge(place: Path, make_events) -> None:
    files(place, make_events)
    one, same, wider = (
        score(place, "scores", *more) for more in ([], ["eqs.tap=memory"], ["eqs.judge.width=8"])
    )
    assert one == same
    assert one["definition"] != wider["definition"]
    assert one["weights_sha256"] != wider["weights_sha256"]


@pytest.mark.parametrize(
    ("override", "sentence"),
    [
        ("eqs.judge._target_=my_judge.Gone", "Expected a class that can be imported as my_judge.G"),
        ("+eqs.judge.depth=3", "Expected settings that my_judge.RandomStages takes"),
        ("eqs.judge._target_=torch.nn.Flatten", "Expected settings that torch.nn.Flatten takes"),
        (
            "eqs.judge._target_=torch.nn.Identity",
            "a Identity without taps, tap_names, strides, in",
        ),
        ("eqs.tap=hidden", "Expected a tap among memory, now, got hidden; set eqs.tap"),
        ("taps=[then]", "Expected a tap among memory, now, got then"),
        ("eqs.bins=5", "Expected 10 bins, as the judge was trained with, got 5"),
        ("eqs.stages=[1,4]", "Expected stages up to 3, got (1, 4); set eqs.stages"),
        ("eqs.features=centred", "Expected a judge with a centre of the activation memory"),
    ],
)
def test_what_does_not_fit_is_said_in_a_sentence(
    place: Path, make_events, caplog: pytest.LogCaptureFixture, override: str, sentence: str
) -> None:
    files(place, make_events)
    with pytest.raises(SystemExit):
        score(place, "refused", override)
    assert sentence in caplog.messages[-1]
    assert not (place / "refused").exists()


@pytest.mark.slow
def test_a_study_is_scored_by_it(place: Path) -> None:
    cfg = configured(
        place,
        "evaluate",
        "score=true",
        "data=dsec_mini_smoke",
        "data.size=64x48",
        "data.generator.frames=8",
        "data.generator.sequences={train: 2, val: 1, test: 2}",
        "+data.generator.workers=1",
        "~sim@simulators.v2e",
        "~sim@simulators.pix2nvs",
    )
    evaluate(cfg)
    results = place / "results/dsec_mini_smoke"
    table = pd.read_csv(results / "eqs.csv")
    assert table["eqs"].equals(table["eqs_memory_silence"])
    assert {"eqs_memory_raw", "eqs_memory_centred", "eqs_now_centred", "eqs_now_raw"} < set(table)
    assert table["baseline_untrained_eqs"].between(-1, 1).all()
    (kept,) = results.glob("judge-*-RandomStages-*")
    judge = Judge.load(kept)
    assert {centre.tap for centre in judge.centres} == {"memory", "now"}
    assert set(table["weights_sha256"]) == {judge.weights_sha256}
    again = find_scoring(cfg, dataset(cfg))
    by_folder = configured(place, "evaluate", "metric=eqs", f"eqs.judge={kept}")
    for headline in (again.headline, find_scoring(by_folder, None).headline):
        assert headline.definition.hash == table["definition"][0]
        assert headline.centre is None
