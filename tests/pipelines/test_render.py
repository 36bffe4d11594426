"""Frames of a street: read by every simulator, whole or not there, of one kind of settings."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_dir

from eqs.events import Events
from eqs.files import read_json
from eqs.frames import FrameFolder
from eqs.pipelines.render import RECORD, frame_times, render
from eqs.pipelines.simulate import open_clip, simulate
from eqs.scenes import DrivingWorld, DSECMini, PaintedStreet, Street, recorded_street

CONFIGS = Path(__file__).parents[2] / "eqs/configs"
PAINTED = ("scene=painted", "height=24", "width=32", "seconds=0.05")


def composed(verb, *overrides):
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        return compose(verb, list(overrides))


def rendered(out, *overrides):
    render(composed("render", f"out={out}", *overrides))
    return {path.name: np.load(path) for path in sorted(out.glob("*.npy"))}


def test_frames_are_the_world_s_light_at_their_times(tmp_path):
    frames = rendered(tmp_path / "clip", *PAINTED, "street.split=val", "street.index=3")
    clip = open_clip(tmp_path / "clip", None, white=1e4)
    assert isinstance(clip, FrameFolder)
    assert clip.timestamps_us.tolist() == [2500 * k for k in range(20)]
    world = DrivingWorld(height=24, width=32, seed=(0, 1, 3, 0), duration_s=3.02)
    for t, frame in zip(clip.timestamps_us, frames.values(), strict=True):
        np.testing.assert_array_equal(frame, world.radiance(int(t)))
    record = read_json(tmp_path / "clip" / RECORD)
    assert record["brightest"] == max(float(frame.max()) for frame in frames.values())
    assert record["description"]["street"]["index"] == 3


def test_the_command_that_is_named_simulates_them(tmp_path, caplog):
    caplog.set_level("INFO")
    rendered(tmp_path / "clip", *PAINTED)
    said = caplog.messages[-1].partition("eqs simulate ")[2].split()
    simulate(composed("simulate", "sim=icns", *said, f"out={tmp_path / 'events.h5'}"))
    assert len(Events.load(tmp_path / "events.h5")) > 50


def test_the_street_of_a_recording_is_that_of_the_data_set():
    plans = DSECMini(sequences={"train": 18, "val": 1, "test": 2}, seed=4).recordings()
    for plan in plans:
        assert recorded_street(plan.split, plan.index, seed=4) == plan.street
    assert recorded_street("train", 17).still
    with pytest.raises(ValueError, match=r"set street\.split and street\.index"):
        recorded_street("tset", 0)


def test_what_was_interrupted_goes_on_where_it_stopped(tmp_path, monkeypatch):
    whole = rendered(tmp_path / "whole", *PAINTED)
    true, asked = PaintedStreet.photocurrent, []

    def interrupted(self, t_us):
        asked.append(t_us)
        if len(asked) == 8:
            raise KeyboardInterrupt
        return true(self, t_us)

    monkeypatch.setattr(PaintedStreet, "photocurrent", interrupted)
    with pytest.raises(SystemExit) as stopped:
        rendered(tmp_path / "clip", *PAINTED)
    assert stopped.value.code == 130
    assert not (tmp_path / "clip/timestamps.txt").exists()
    again = rendered(tmp_path / "clip", *PAINTED)
    assert len(asked) == 8 + 13
    assert again.keys() == whole.keys()
    assert all((again[name] == whole[name]).all() for name in whole)
    rendered(tmp_path / "clip", *PAINTED)
    assert len(asked) == 8 + 13


def test_a_killed_tracing_goes_on_to_the_same_frames(tmp_path):
    pytest.importorskip("mitsuba")
    settings = ["height=24", "width=32", "seconds=0.1", "scene.samples_per_pixel=16"]
    out = tmp_path / "clip"
    command = [sys.executable, "-m", "eqs", "render", f"out={out}", *settings]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL)
    until = time.monotonic() + 60
    while len(list(out.glob("*.npy"))) < 3 and time.monotonic() < until:
        time.sleep(0.005)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    there = {path: path.stat().st_mtime_ns for path in out.glob("*.npy")}
    assert 3 <= len(there) < 40
    resumed = rendered(out, *settings)
    assert all(path.stat().st_mtime_ns == at for path, at in there.items())
    whole = rendered(tmp_path / "whole", *settings)
    assert resumed.keys() == whole.keys()
    assert all((resumed[name] == whole[name]).all() for name in whole)


def test_more_seconds_are_added_and_fewer_refused(tmp_path, caplog):
    short = rendered(tmp_path / "clip", *PAINTED)
    long = rendered(tmp_path / "clip", *PAINTED, "seconds=0.1")
    assert (len(short), len(long)) == (20, 40)
    assert all((short[name] == long[name]).all() for name in short)
    with pytest.raises(SystemExit):
        rendered(tmp_path / "clip", *PAINTED)
    assert "Expected at most 20 frames" in caplog.messages[-1]


@pytest.mark.parametrize("change", ["seed=1", "frames_per_second=200", "street.split=train"])
def test_other_settings_are_told_apart(tmp_path, caplog, change):
    before = rendered(tmp_path / "clip", *PAINTED)
    with pytest.raises(SystemExit):
        rendered(tmp_path / "clip", *PAINTED, change)
    assert "set out, or overwrite=true" in caplog.messages[-1]
    after = rendered(tmp_path / "clip", *PAINTED, change, "overwrite=true")
    assert (after["000003.npy"] != before["000003.npy"]).any()


def test_what_others_wrote_is_left_alone(tmp_path, caplog):
    (tmp_path / "clip").mkdir()
    (tmp_path / "clip/notes.txt").write_text("mine")
    with pytest.raises(SystemExit):
        rendered(tmp_path / "clip", *PAINTED, "overwrite=true")
    assert "what this command did not write; set out" in caplog.messages[-1]
    assert [path.name for path in (tmp_path / "clip").iterdir()] == ["notes.txt"]


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        (["frames_per_second=0"], "set frames_per_second and seconds"),
        (["seconds=0.002"], "Expected at least two frames, got 1; set seconds"),
        (["street.index=-1"], "set street.split and street.index"),
    ],
)
def test_mistakes_end_in_a_sentence_and_leave_nothing(tmp_path, caplog, overrides, said):
    with pytest.raises(SystemExit):
        rendered(tmp_path / "clip", *PAINTED, *overrides)
    assert said in caplog.messages[-1]
    assert not (tmp_path / "clip").exists()


def test_times_are_whole_and_increase():
    assert frame_times(30, 0.1) == [0, 33_333, 66_667]
    assert np.diff(frame_times(1e6, 1e-4)).tolist() == [1] * 99


def test_a_street_of_one_s_own(tmp_path):
    night = rendered(tmp_path / "night", *PAINTED, "street=own", "seed=7", "street.night=true")
    world = PaintedStreet(
        height=24, width=32, **vars(Street(seed=(7,), night=True, duration_s=3.02))
    )
    np.testing.assert_array_equal(night["000002.npy"], world.photocurrent(5000))
