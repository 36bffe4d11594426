"""Folders of event files: pairs by name, equal numbers, what is kept and what is said."""

import json
from pathlib import Path

import pandas as pd
import pytest
from hydra import compose, initialize_config_dir

from eqs.pipelines import score_folders as module
from eqs.pipelines.resolvers import register_resolvers
from eqs.pipelines.score_files import score_files
from eqs.pipelines.score_folders import event_files, find_pairs

CONFIGS = Path(__file__).parents[2] / "eqs/configs"


def run(simulated, real, out, *overrides):
    register_resolvers()
    given = [f"simulated={simulated}", f"real={real}", f"out={out}", "eqs.judge=random", "taps=[]"]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        score_files(compose("score", [*given, f"paths.runs={out}/runs", *overrides]))


@pytest.fixture
def folders(tmp_path, make_events):
    """Two recordings, real and of two simulators; one real file lies in DSEC's tree."""
    seeds = {"real": (0, 1), "made/fine": (2, 3), "made/rough": (4, 5)}
    for folder, (first, second) in seeds.items():
        for name, seed in (("a", first), ("b", second)):
            inside = (
                f"{name}/events/left/events.h5" if (folder, name) == ("real", "b") else f"{name}.h5"
            )
            path = tmp_path / folder / inside
            make_events(20_000, 32, 64, stop_us=1_500_000, seed=seed).save(path)
    return tmp_path


def test_a_folder_says_of_every_pair_what_the_pair_alone_says(folders, tmp_path, capsys):
    run(folders / "made/fine", folders / "real", tmp_path / "out")
    table = pd.read_csv(tmp_path / "out/eqs.csv")
    assert table["sequence"].tolist() == ["a", "b"]
    assert set(table["system"]) == {"fine"}
    assert table["eqs_chance"].notna().all()  # the other recording lends it
    for name, real in (("a", "a.h5"), ("b", "b/events/left/events.h5")):
        alone = tmp_path / f"alone_{name}"
        run(folders / f"made/fine/{name}.h5", folders / "real" / real, alone)
        found = json.loads((alone / "score.json").read_text())
        row = table.set_index("sequence").loc[name]
        assert row["eqs"] == found["eqs"]
        assert row["n_events_sim"] == found["events"]["simulated"]
        assert row["eqs_ceiling"] == pytest.approx(
            next(iter(found["anchors"]["ceiling"].values())), abs=0.01
        )
    page = (tmp_path / "out/report.html").read_text()
    assert "data:image/svg+xml" in page or "data:image/png" in page
    assert "EQS by sequence" in capsys.readouterr().out


def test_several_simulators_stand_in_one_table(folders, tmp_path):
    run(folders / "made", folders / "real", tmp_path / "out")
    table = pd.read_csv(tmp_path / "out/eqs.csv")
    assert table.groupby("system")["sequence"].apply(list).to_dict() == {
        "fine": ["a", "b"],
        "rough": ["a", "b"],
    }
    assert table.filter(like="baseline").notna().all(axis=None)


def test_what_was_scored_is_kept_until_a_file_changes(folders, tmp_path, make_events, monkeypatch):
    run(folders / "made", folders / "real", tmp_path / "out")
    before = (tmp_path / "out/eqs.csv").read_text()
    asked = []
    plain = module.scored
    monkeypatch.setattr(module, "scored", lambda *a: asked.append(a[3]) or plain(*a))
    run(folders / "made", folders / "real", tmp_path / "out")
    assert asked == []
    assert (tmp_path / "out/eqs.csv").read_text() == before
    make_events(9_000, 32, 64, stop_us=1_500_000, seed=9).save(folders / "made/rough/b.h5")
    run(folders / "made", folders / "real", tmp_path / "out")
    assert asked == ["b"]
    run(folders / "made", folders / "real", tmp_path / "out", "stop_us=1200000")
    assert asked == ["b", "a", "b"]


def test_what_has_no_partner_is_named(folders, tmp_path, caplog):
    (folders / "made/fine/b.h5").rename(folders / "made/fine/c.h5")
    pairs = find_pairs(folders / "made/fine", folders / "real")
    assert pairs.recordings == ["a"]
    assert "fine: no real file of c, left out" in caplog.text
    assert "fine has no file of b" in caplog.text
    (folders / "made/fine/a.h5").rename(folders / "made/fine/d.h5")
    with pytest.raises(ValueError, match=r"files of equal names .*got c, d and a, b; name each"):
        find_pairs(folders / "made/fine", folders / "real")
    with pytest.raises(SystemExit):
        run(folders / "made/fine", folders / "real/a.h5", tmp_path / "out")
    assert "two files or two folders, got one of each" in caplog.text


def test_two_files_of_one_recording_are_refused(tmp_path):
    for name in ("a.h5", "a.raw", ".hidden.h5", "notes.md"):
        (tmp_path / name).touch()
    with pytest.raises(ValueError, match=r"one event file of a in .*got a\.h5 and a\.raw"):
        event_files(tmp_path)
    (tmp_path / "a.raw").unlink()
    assert event_files(tmp_path) == {"a": tmp_path / "a.h5"}
