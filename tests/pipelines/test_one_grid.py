"""Every command cuts one pair of streams into the same windows."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_dir

from eqs.data import Recording
from eqs.data.simulated import write_stream
from eqs.events import EventReader
from eqs.pipelines.calibrate import Clip
from eqs.pipelines.sanity import damaged_scores
from eqs.pipelines.score import Scene, Scores, recording_grid, score_scene
from eqs.pipelines.score_files import score_files
from eqs.pipelines.scoring import find_scoring
from eqs.simulators import V2E

CONFIGS = Path(__file__).parents[2] / "eqs/configs"
FIRST, LAST = 1_000_000, 1_950_000  # of the frames
LATE = 1_110_000

# What the real file says: when its events begin and end, and the span it states.
REAL = {
    "events beyond the frames": (900_000, 2_100_000, None),
    "events that begin late and end early": (LATE, 1_880_000, None),
    "a span that is the frames'": (LATE, 1_880_000, (FIRST, LAST)),
    "a span beyond the frames": (LATE, 1_880_000, (900_000, 2_100_000)),
    "a span within the frames": (LATE, 1_700_000, (1_025_000, 1_790_000)),
    "events that end before the simulated ones begin": (FIRST, 1_400_000, None),
}


def configured(out, *overrides):
    given = [f"out={out}", f"paths.runs={out}/runs", "eqs.judge=random", "taps=[]", "device=cpu"]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        return compose("score", [*given, *overrides])


@pytest.fixture(scope="module")
def folder(make_recording, tmp_path_factory):
    return make_recording(tmp_path_factory.mktemp("grid") / "a", frames=20, height=32, width=48)


@pytest.fixture
def recorded(folder, make_events):
    """A recording whose real events lie as told."""

    def record(start_us, stop_us, span_us):
        recording = Recording.load(folder)
        events = make_events(8_000, 32, 48, start_us, stop_us)
        replace(events, span_us=span_us).save(recording.events_path)
        return recording

    return record


@pytest.fixture(scope="module")
def simulated(folder, make_events):
    """What a simulator wrote from the frames, with all events but late ones taken out."""
    recording, path = Recording.load(folder), folder.parent / "simulated.h5"
    write_stream(V2E(), "a", recording.frames(), path)
    with EventReader(path) as reader:
        late = replace(reader.window(1_500_000, LAST), span_us=reader.span_us)
    assert len(late)
    late.save(path)
    return path


@pytest.mark.parametrize("real", REAL)
def test_a_study_and_two_files_give_one_number(real, recorded, simulated, tmp_path):
    recording = recorded(*REAL[real])
    cfg = configured(tmp_path, f"simulated={simulated}", f"real={recording.events_path}")
    score_files(cfg)
    files = json.loads((tmp_path / "score.json").read_text())
    scoring, scores = find_scoring(cfg, None), Scores()
    with EventReader(recording.events_path) as truth, EventReader(simulated) as stream:
        grid = recording_grid(recording, truth, scoring.headline.definition.window_us)
        scene = Scene(name="a", grid=grid, frame_times_us=recording.frame_times_us)
        score_scene(scoring, scene, truth, {"v2e": stream}, None, scores)
    (row,) = scores.rows
    assert files["definition"] == row["definition"]
    assert files["span_us"] == [row["start_us"], row["stop_us"]]
    assert files["windows"] == row["n_windows"]
    assert files["events"] == {"simulated": row["n_events_sim"], "real": row["n_events_real"]}
    assert files["eqs"] == row["eqs"]


def test_a_stated_span_is_scored_where_the_real_sensor_was_silent(recorded):
    recording = recorded(*REAL["a span that is the frames'"])
    with EventReader(recording.events_path) as real:
        grid = recording_grid(recording, real, 50_000)
    assert (grid.start_us, grid.stop_us, grid.count, grid.share) == (FIRST, LAST, 19, 1.0)


@pytest.mark.parametrize("real", ["a span within the frames", "a span beyond the frames"])
def test_the_battery_and_a_calibration_look_at_the_same_windows(
    real, recorded, tmp_path, monkeypatch
):
    recording = recorded(*REAL[real])
    scoring = find_scoring(configured(tmp_path), None)
    with EventReader(recording.events_path) as reader:
        grid = recording_grid(recording, reader, 50_000)
    clip = Clip.of(recording, None, 50_000)
    assert (clip.start_us, clip.stop_us) == (grid.start_us, grid.stop_us)
    limits = []
    score = type(scoring).score

    def watched(self, *given, start_us, stop_us, **others):
        limits.append((start_us, stop_us))
        return score(self, *given, start_us=start_us, stop_us=stop_us, **others)

    monkeypatch.setattr(type(scoring), "score", watched)
    damaged_scores(scoring, recording, recording, None)
    assert set(limits) == {(grid.start_us, grid.stop_us)}


def test_a_calibration_counts_the_events_of_the_windows_alone(recorded, tmp_path, make_events):
    recording = recorded(*REAL["events that begin late and end early"])
    scoring = find_scoring(configured(tmp_path), None)
    clip = Clip.of(recording, None, 50_000)
    events = make_events(4_000, 32, 48, FIRST, LAST)

    class Fixed:
        def simulate(self, *_):
            return events

    inside = events.window(clip.start_us, clip.stop_us)
    assert len(inside) < len(events)
    found = clip.measures(scoring, Fixed())["events_per_real_event"]
    assert found == pytest.approx(len(inside) / len(clip.real))


def test_a_recording_without_frames_is_refused_in_one_sentence(recorded):
    recording = replace(recorded(*REAL["a span beyond the frames"]), frame_times_us=np.empty(0))
    with (
        EventReader(recording.events_path) as real,
        pytest.raises(ValueError, match="Expected frames that say which time is scored, got none"),
    ):
        recording_grid(recording, real, 50_000)
