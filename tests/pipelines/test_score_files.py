"""Two event files to one score, as scripts/score.py does it."""

import csv
import json
import runpy
from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_dir

from eqs.metrics import scoring
from eqs.pipelines.score_files import score_files

CONFIGS = Path(__file__).parents[2] / "eqs/configs"


@pytest.fixture
def files(make_events, tmp_path):
    """Two seconds of two unrelated streams, 64x96 pixels."""
    paths = []
    for seed in (0, 1):
        path = tmp_path / f"{seed}.h5"
        make_events(40_000, 64, 96, stop_us=2_000_000, seed=seed).save(path)
        paths.append(path)
    return paths


def run(simulated, real, out, *overrides):
    given = [f"simulated={simulated}", f"real={real}", f"out={out}", "eqs.judge=random"]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose("score", [*given, f"paths.runs={out}/runs", *overrides])
    score_files(cfg)


def test_a_stream_against_itself_scores_one_everywhere(files, tmp_path):
    run(files[0], files[0], tmp_path / "out")
    found = json.loads((tmp_path / "out" / "score.json").read_text())
    assert found["eqs"] == pytest.approx(1.0, abs=1e-6)
    assert all(score == pytest.approx(1.0, abs=1e-6) for score in found["readings"].values())
    assert found["events"]["simulated"] == found["events"]["real"] > 0


def test_counts_and_pooling_reach_the_score(files, tmp_path):
    found = {}
    for name, overrides in {
        "default": [],
        "counts": ["eqs.counts=normalised"],
        "pooling": ["eqs.pooling=smooth"],
    }.items():
        run(files[1], files[0], tmp_path / name, "taps=[]", *overrides)
        found[name] = json.loads((tmp_path / name / "score.json").read_text())
    assert len({each["eqs"] for each in found.values()}) == 3
    assert len({each["definition"] for each in found.values()}) == 3


def test_files_beside_the_score(files, tmp_path):
    out = tmp_path / "out"
    run(files[1], files[0], out)
    found = json.loads((out / "score.json").read_text())
    assert found["eqs"] < found["anchors"]["ceiling"]["hidden_raw"] < 1.0
    with (out / "curve.csv").open() as file:
        rows = list(csv.DictReader(file))
    counted = [float(row["eqs"]) for row in rows if row["counts"] == "True"]
    assert len(counted) == found["windows"]
    assert np.mean(counted) == pytest.approx(found["eqs"], abs=1e-6)
    assert {path.name for path in out.glob("*.png")} == {"map.png", "curve.png"}


def test_a_missing_file_ends_in_one_sentence(files, tmp_path, caplog):
    with pytest.raises(SystemExit):
        run(tmp_path / "none.h5", files[0], tmp_path / "out")
    assert "Expected an event file at" in caplog.text
    assert not (tmp_path / "out" / "score.json").exists()


def test_two_plain_arguments_are_the_files_even_if_they_are_one(files, tmp_path, monkeypatch):
    paths = [f"paths.{key}={tmp_path / key}" for key in ("runs", "results", "logs")]
    given = [*map(str, (files[0], files[0])), "eqs.judge=random", f"out={tmp_path / 'out'}"]
    monkeypatch.setattr("sys.argv", ["score.py", *given, *paths])
    runpy.run_path(str(CONFIGS.parents[1] / "scripts" / "score.py"), run_name="__main__")
    assert json.loads((tmp_path / "out" / "score.json").read_text())["eqs"] == pytest.approx(1.0)


def test_no_such_device_ends_in_one_sentence(files, tmp_path, caplog):
    with pytest.raises(SystemExit):
        run(files[1], files[0], tmp_path / "out", "device=cuda:99")
    assert "Expected device auto, cpu or a GPU that is there, got 'cuda:99'" in caplog.text


def test_windows_per_pass_are_those_asked_for(files, tmp_path, monkeypatch):
    seen = []
    plain = scoring.pooled_features

    def watched(backbone, chunks, **given):
        return plain(backbone, (seen.append(len(chunk)) or chunk for chunk in chunks), **given)

    monkeypatch.setattr(scoring, "pooled_features", watched)
    run(files[1], files[0], tmp_path / "out", "eqs.chunk_windows=3", "taps=[]")
    assert max(seen) == 3


def test_the_span_may_be_given_and_is_written_down(files, tmp_path):
    run(files[1], files[0], tmp_path / "out", "start_us=500000", "stop_us=1520000", "taps=[]")
    found = json.loads((tmp_path / "out" / "score.json").read_text())
    assert found["span_us"] == [500_000, 1_500_000]
    assert found["windows"] == 15
