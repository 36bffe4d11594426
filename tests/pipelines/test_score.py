"""Scores of a study's recordings: which of them lends the chance level."""

import logging
from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_dir
from rich.console import Console

from eqs.data import Dataset, RecordedEvents, Recording
from eqs.events import EventReader
from eqs.pipelines import sanity as battery
from eqs.pipelines.score import partner, score_recordings
from eqs.pipelines.scoring import find_scoring

CONFIGS = Path(__file__).parents[2] / "eqs/configs"
SIZES = {"a": (32, 48), "b": (40, 48), "c": (32, 48), "d": (64, 48)}


@pytest.fixture(scope="module")
def recordings(make_recording, tmp_path_factory):
    root = tmp_path_factory.mktemp("sizes")
    return [
        Recording.load(make_recording(root / name, height=height, width=width, seed=ord(name)))
        for name, (height, width) in SIZES.items()
    ]


@pytest.fixture
def cfg(tmp_path):
    given = [f"paths.runs={tmp_path}", "eqs.judge=random", "taps=[]", "device=cpu"]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        return compose("evaluate", given)


def test_the_partner_is_the_next_recording_of_the_same_size(recordings):
    a, b, c, d = recordings
    assert partner(a, [b, c, d]) is c
    assert partner(c, [d, a, b]) is a
    assert partner(b, [c, d, a]) is None
    assert partner(a, [b, c, d], rows=32) is b  # the crop makes them alike
    assert partner(b, [c, d, a], rows=40) is d
    assert partner(a, []) is None


def test_chance_is_known_wherever_another_recording_has_the_size(recordings, cfg):
    scores = score_recordings(find_scoring(cfg, None), recordings, {"again": RecordedEvents()})
    chance = {row["sequence"]: row["eqs_chance"] for row in scores.rows}
    assert {name for name, value in chance.items() if np.isfinite(value)} == {"a", "c"}
    assert all(-1 <= chance[name] < 0.999 for name in ("a", "c"))
    with EventReader(recordings[0].events_path) as real:
        first = real.start_us  # after the first frame, so that it sets the windows
    found = scores.rows[0]
    assert (found["start_us"], found["stop_us"]) == (first, first + 4 * 50_000)
    assert found["n_windows"] == 3  # a quarter is warm-up


class Data(Dataset):
    """A data set of these recordings."""

    name, split_names = "these", ("test",)

    def __init__(self, recordings):
        self.found = recordings

    def recordings(self, _):
        return self.found


@pytest.fixture
def drawn(monkeypatch):
    monkeypatch.setattr(battery, "GRADED", battery.GRADED[:1])
    monkeypatch.setattr(battery, "save_figure", lambda *_: None)
    tables = []
    monkeypatch.setattr(battery, "write_table", lambda table, _: tables.append(table))
    return tables


def test_the_battery_borrows_a_partner_beyond_the_recordings_it_damages(
    recordings, cfg, tmp_path, monkeypatch, drawn
):
    monkeypatch.setattr(battery, "dataset", lambda _: Data(recordings))
    cfg.sanity_recordings = 1
    battery.sanity(cfg, tmp_path, Console(quiet=True))
    assert "chance" in set(drawn[0]["corruption"])


def test_the_battery_names_what_its_means_leave_out(
    recordings, cfg, tmp_path, monkeypatch, drawn, caplog
):
    monkeypatch.setattr(battery, "dataset", lambda _: Data([*recordings[:3]]))
    with caplog.at_level(logging.WARNING):
        battery.sanity(cfg, tmp_path, Console(quiet=True))
    assert "Means cover 2 of 3 recordings" in caplog.text
    assert "Few windows count in a (3), b (3), c (3)" in caplog.text
    assert set(drawn[0]["sequences"]) == {2}
