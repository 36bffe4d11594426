"""Two event files to one score, as scripts/score.py does it."""

import csv
import json
import re
import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_dir

from eqs.events import Events
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
    given.append("nearest=false")  # as most of these tests do not ask for it
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
        "pooling": ["eqs.pooling=smooth", "eqs.patch_size=2"],
    }.items():
        run(files[1], files[0], tmp_path / name, "taps=[]", *overrides)
        found[name] = json.loads((tmp_path / name / "score.json").read_text())
    assert len({each["eqs"] for each in found.values()}) == 3
    assert len({each["definition"] for each in found.values()}) == 3


def test_files_beside_the_score(files, tmp_path):
    out = tmp_path / "out"
    run(files[1], files[0], out, "nearest=true")
    found = json.loads((out / "score.json").read_text())
    assert found["eqs"] < found["anchors"]["ceiling"]["hidden_silence"] < 1.0
    with (out / "curve.csv").open() as file:
        rows = list(csv.DictReader(file))
    counted = [float(row["eqs"]) for row in rows if row["counts"] == "True"]
    assert len(counted) == found["windows"]
    assert np.mean(counted) == pytest.approx(found["eqs"], abs=1e-6)
    assert {path.name for path in out.glob("*.png")} == {"map.png", "curve.png"}
    assert found["blank"] == pytest.approx(0.0, abs=1e-3)
    assert found["blank"] < found["chance"] < found["ceiling"]
    assert {"family", "grade", "score", "words", "apart"} == found["nearest"][0].keys()
    assert (found["reading"], found["nearest_us"]) == ("hidden_silence", 1_950_000)
    assert found["nearest_eqs"] == pytest.approx(found["eqs"], abs=1e-6)  # all windows were tried
    seconds, pixels = 1.95, 64 * 96
    per_pixel = found["events"]["real"] / seconds / pixels
    assert found["rates"]["real_per_pixel_and_second"] == pytest.approx(per_pixel)
    ratio = found["events"]["simulated"] / found["events"]["real"]
    assert found["rates"]["simulated_per_real"] == pytest.approx(ratio)
    rates = {line["name"]: line for line in found["diagnosis"]}["event rate"]
    assert rates["simulated"] == pytest.approx(rates["real"], rel=0.05)
    assert "mine" not in (page := (out / "score.html").read_text())
    assert page.count("data:image/png") == 3 * 39


def test_another_recording_may_lend_chance(files, tmp_path, make_events, caplog):
    make_events(90_000, 64, 96, stop_us=2_000_000, seed=9).save(tmp_path / "other.h5")
    found = result(files[1], files[0], tmp_path / "out", f"other={tmp_path / 'other.h5'}")
    assert found["chance_is"].endswith("other.h5")
    assert found["chance"] != result(files[1], files[0], tmp_path / "own")["chance"]
    make_events(900, 32, 32, stop_us=2_000_000, seed=9).save(tmp_path / "small.h5")
    with pytest.raises(SystemExit):
        result(files[1], files[0], tmp_path / "no", f"other={tmp_path / 'small.h5'}")
    assert "Expected another recording of 96x64 pixels, got one of 32x32" in caplog.messages[-1]


def test_a_stream_is_as_far_as_the_damage_that_it_is(files, tmp_path, capsys):
    real = Events.load(files[0])
    keep = np.random.default_rng(0).random(len(real)) < 0.5
    fields = {name: getattr(real, name)[keep] for name in "txyp"}
    Events(**fields, height=64, width=96, span_us=real.extent_us).save(tmp_path / "half.h5")
    found = result(tmp_path / "half.h5", files[0], tmp_path / "out", "nearest=true")
    assert found["nearest"][0]["family"] == "dropped"
    assert found["nearest"][0]["grade"] == pytest.approx(0.5, abs=0.1)
    printed = capsys.readouterr().out
    assert re.search(r"as far from real as: [45]\d% of the events missing", printed)
    assert "0.50 simulated events per real one" in printed
    assert re.search(r"hidden_silence: 0\.\d+, \d+ % of the way from chance to ceiling", printed)
    assert result(files[1], files[0], tmp_path / "none")["nearest"] == []


def test_a_missing_file_ends_in_one_sentence(files, tmp_path, caplog):
    with pytest.raises(SystemExit):
        run(tmp_path / "none.h5", files[0], tmp_path / "out")
    assert "Expected an event file at" in caplog.text
    assert not (tmp_path / "out" / "score.json").exists()


def test_two_plain_arguments_are_the_files_even_if_they_are_one(files, tmp_path, monkeypatch):
    paths = [f"paths.{key}={tmp_path / key}" for key in ("runs", "results", "logs")]
    given = [*map(str, (files[0], files[0])), "eqs.judge=random", f"out={tmp_path / 'out'}"]
    given.append("nearest=false")
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


def result(simulated, real, out, *overrides):
    run(simulated, real, out, "taps=[]", *overrides)
    return json.loads((out / "score.json").read_text())


def shown(text):
    return " ".join(text.split())


def test_the_output_says_what_was_scored(files, tmp_path, capsys):
    limits = ["start_us=500000", "stop_us=1520000"]
    found = result(files[1], files[0], tmp_path / "out", *limits)
    extent = Events.load(files[0]).extent_us
    assert found["share"] == pytest.approx(1_000_000 / (extent[1] - extent[0]))
    assert found["sensor"] == [64, 96]
    assert (
        f"scored from 500000 us to 1500000 us, {100 * found['share']:.1f} % of the real file: "
        "20 windows, of which 15 count after the warm-up, 0.75 s"
    ) in shown(capsys.readouterr().out)


def test_a_file_that_states_no_span_is_named(files, tmp_path, caplog):
    found = result(files[1], files[0], tmp_path / "out")
    assert "1.h5 does not say from when to when its camera was watching" in caplog.text
    assert found["simulated_span_us"] is None
    caplog.clear()
    result(files[1], files[0], tmp_path / "given", "start_us=0", "stop_us=1000000")
    assert "does not say" not in caplog.text
    stated = replace(Events.load(files[1]), span_us=(200_000, 1_210_000))
    stated.save(tmp_path / "stated.h5")
    found = result(tmp_path / "stated.h5", files[0], tmp_path / "stated")
    assert "does not say" not in caplog.text
    assert found["simulated_span_us"] == [200_000, 1_210_000]
    assert found["span_us"] == [200_000, 1_200_000]


@pytest.mark.parametrize("span_us", [None, (0, 2_000_000)])
def test_a_file_without_events_is_scored_as_silence(files, tmp_path, span_us):
    silence = replace(Events.empty(64, 96), span_us=span_us)
    silence.save(tmp_path / "silence.h5")
    found = result(tmp_path / "silence.h5", files[0], tmp_path / "out")
    assert found["events"]["simulated"] == 0 < found["events"]["real"]
    assert found["eqs"] == pytest.approx(found["blank"], abs=1e-4)
    assert found["eqs"] == pytest.approx(0.0, abs=1e-3)
    assert found["share"] > 0.95


@pytest.mark.parametrize("kept", [(0, 1_000_000), (1_000_000, 2_000_000)])
def test_silence_at_either_end_counts(files, tmp_path, kept):
    real = Events.load(files[0])
    replace(real.window(*kept), span_us=None).save(tmp_path / "half.h5")
    found = result(tmp_path / "half.h5", files[0], tmp_path / "out", "eqs.warmup_windows=0")
    assert found["windows"] == 39
    assert found["eqs"] < 0.999
    with (tmp_path / "out" / "curve.csv").open() as file:
        rows = list(csv.DictReader(file))
    silent = [float(r["eqs"]) for r in rows if not kept[0] < int(r["stop_us"]) <= kept[1]]
    assert len(silent) in (19, 20)
    assert np.mean(silent) < min(0.999, found["eqs"])


def test_rows_leave_out_what_lies_below(files, tmp_path):
    whole = Events.load(files[0])
    top = whole.y < 32
    fields = {name: getattr(whole, name)[top] for name in "txyp"}
    Events(**fields, height=64, width=96).save(tmp_path / "top.h5")
    limits = ["start_us=0", "stop_us=2000000"]
    found = result(tmp_path / "top.h5", files[0], tmp_path / "rows", "rows=32", *limits)
    assert found["sensor"] == [32, 96]
    assert found["eqs"] == pytest.approx(1.0, abs=1e-6)
    assert result(tmp_path / "top.h5", files[0], tmp_path / "all", *limits)["eqs"] < 0.999


def test_few_windows_are_named(files, tmp_path, caplog):
    result(files[1], files[0], tmp_path / "out", "start_us=0", "stop_us=1000000")
    assert "Few windows count (15): a score of fewer than 20 says little" in caplog.text
    caplog.clear()
    result(files[1], files[0], tmp_path / "whole", "start_us=0", "stop_us=2000000")
    assert "Few windows" not in caplog.text


def test_files_of_something_else_are_left_alone(files, tmp_path, caplog):
    out = tmp_path / "out"
    out.mkdir()
    (out / "curve.csv").write_text("mine")
    with pytest.raises(SystemExit):
        run(files[1], files[0], out, "taps=[]")
    assert "got curve.csv of something else; set out" in caplog.messages[-1]
    assert (out / "curve.csv").read_text() == "mine"
