"""One clip to one event file, as scripts/simulate.py does it."""

import os
import re
from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_dir
from PIL import Image

from eqs.events import Events
from eqs.pipelines.build import dataset, event_source
from eqs.pipelines.simulate import simulate
from eqs.simulators import V2E

CONFIGS = Path(__file__).parents[2] / "eqs/configs"


@pytest.fixture
def clip(tmp_path):
    """A folder of twenty random frames at 100 Hz, and the frames."""
    frames = np.random.default_rng(0).integers(0, 256, (20, 12, 16), dtype=np.uint8)
    folder = tmp_path / "frames"
    folder.mkdir()
    for index, frame in enumerate(frames):
        Image.fromarray(frame).save(folder / f"{index:03d}.png")
    return folder, frames


def run(folder, out, *overrides):
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose("simulate", [f"frames={folder}", f"out={out}", *overrides])
    simulate(cfg)


def test_the_file_holds_what_the_simulator_gives(clip, tmp_path):
    folder, frames = clip
    out = tmp_path / "new" / "events.h5"
    run(folder, out, "sim=v2e", "frames_per_second=100", "sim.threshold_on_log=0.4")
    found = Events.load(out)
    expected = V2E(threshold_on_log=0.4).start("events")
    parts = [expected.step(frames, np.arange(20) * 10_000), expected.finish()]
    wanted = Events.concatenate(parts)
    assert len(found) == len(wanted) > 1000
    for name in "txyp":
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name))


def test_a_readout_holds_the_events_back(clip, tmp_path):
    folder, _ = clip
    rate = "frames_per_second=100"
    run(folder, tmp_path / "all.h5", rate)
    run(folder, tmp_path / "slow.h5", rate, "readout=bottleneck", "readout.service_us=60")
    arisen, left = Events.load(tmp_path / "all.h5"), Events.load(tmp_path / "slow.h5")
    assert len(left) == len(arisen)
    assert np.diff(arisen.t).min() == 0
    assert np.diff(left.t).min() == 60


def test_times_beside_the_folder_are_taken(clip, tmp_path):
    folder, _ = clip
    times = 7_000_000 + 33_333 * np.arange(20)
    (tmp_path / "timestamps.txt").write_text("\n".join(map(str, times)))
    run(folder, tmp_path / "events.h5")
    found = Events.load(tmp_path / "events.h5")
    assert times[0] <= found.t[0]
    assert found.t[-1] <= times[-1]


def test_a_finished_file_is_kept_and_another_refused(clip, tmp_path, caplog):
    folder, _ = clip
    out = tmp_path / "events.h5"
    run(folder, out, "frames_per_second=30")
    before = out.stat().st_mtime_ns
    run(folder, out, "frames_per_second=30")
    assert out.stat().st_mtime_ns == before
    with pytest.raises(SystemExit):
        run(folder, out, "frames_per_second=25")
    assert "set out, or overwrite=true" in caplog.text
    run(folder, out, "frames_per_second=25", "overwrite=true")
    assert out.stat().st_mtime_ns != before


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ([], "Expected timestamps.txt in .* or a frame rate above zero, got None"),
        (["frames_per_second=0"], "a frame rate above zero, got 0; set frames_per_second"),
        (["frames_per_second=30", "sim=real"], "Expected a simulator, got sim=real"),
        (["frames_per_second=30", "frames=nowhere"], "Expected no frame rate for nowhere"),
        (["frames=nowhere"], "Expected a video at nowhere, found none; set frames"),
    ],
)
def test_mistakes_end_in_one_sentence_and_leave_nothing(clip, tmp_path, caplog, overrides, message):
    folder, _ = clip
    with pytest.raises(SystemExit):
        run(folder, tmp_path / "events.h5", *overrides)
    assert len(caplog.messages) == 1
    assert re.search(message, caplog.messages[0])
    assert list(tmp_path.glob("events*")) == []


def test_a_single_frame_is_no_clip(clip, tmp_path, caplog):
    folder, _ = clip
    for path in sorted(folder.iterdir())[1:]:
        path.unlink()
    with pytest.raises(SystemExit):
        run(folder, tmp_path / "events.h5", "frames_per_second=30")
    assert "at least two frames, got 1" in caplog.text
    assert list(tmp_path.glob("events*")) == []


def test_a_data_set_is_simulated_where_trainings_look(tmp_path, make_recording, caplog):
    for index, name in enumerate("ab"):
        make_recording(tmp_path / "data" / name, seed=index)
    root, stored = tmp_path / "data", tmp_path / "simulated"
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        options = [
            "data=recordings",
            f"data.root={root}",
            f"paths.simulated={stored}",
            "sim=pix2nvs",
        ]
        cfg = compose("simulate", options)
    simulate(cfg)
    recordings = dataset(cfg).all_recordings()
    paths = [event_source(cfg.sim, cfg).path(recording) for recording in recordings]
    assert [len(Events.load(path)) > 0 for path in paths] == [True, True]
    before = [path.stat().st_mtime_ns for path in paths]
    simulate(cfg)
    assert [path.stat().st_mtime_ns for path in paths] == before


@pytest.mark.parametrize(
    ("overrides", "found"), [([], "neither"), (["frames=clip.mp4", "data=dsec_mini"], "both")]
)
def test_a_clip_or_a_data_set_is_wanted(caplog, overrides, found):
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose("simulate", overrides)
    with pytest.raises(SystemExit):
        simulate(cfg)
    assert f"Expected a clip or a data set, got {found}; set frames or data" in caplog.text


def test_what_is_not_provably_ours_is_left_alone(clip, tmp_path, caplog):
    folder, _ = clip
    out = tmp_path / "events.h5"
    out.write_bytes(b"recorded by somebody")
    with pytest.raises(SystemExit):
        run(folder, out, "frames_per_second=30")
    assert "got a file that this command did not write" in caplog.messages[-1]
    assert out.read_bytes() == b"recorded by somebody"
    run(folder, out, "frames_per_second=30", "overwrite=true")
    made = out.read_bytes()
    out.write_bytes(b"recorded again")  # beside the record of what was made
    with pytest.raises(SystemExit):
        run(folder, out, "frames_per_second=30")
    assert out.read_bytes() == b"recorded again"
    (tmp_path / "labels.h5.json").write_text('{"mine": 1}')
    with pytest.raises(SystemExit):
        run(folder, tmp_path / "labels.h5", "frames_per_second=30")
    assert (tmp_path / "labels.h5.json").read_text() == '{"mine": 1}'
    run(folder, out, "frames_per_second=30", "overwrite=true")
    assert out.read_bytes() == made


@pytest.mark.parametrize("change", ["frame", "times"])
def test_changed_frames_and_times_are_other_events(clip, tmp_path, caplog, change):
    folder, _ = clip
    (tmp_path / "timestamps.txt").write_text("\n".join(map(str, range(0, 200_000, 10_000))))
    run(folder, tmp_path / "events.h5")
    path = folder / "003.png"
    before = path.stat()
    if change == "frame":
        content = path.read_bytes()
        path.write_bytes((folder / "004.png").read_bytes().ljust(len(content), b"\0"))
        os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    else:
        (tmp_path / "timestamps.txt").write_text("\n".join(map(str, range(0, 400_000, 20_000))))
    with pytest.raises(SystemExit):
        run(folder, tmp_path / "events.h5")
    assert "got events made of other frames or with other parameters" in caplog.messages[-1]


def test_a_folder_is_no_file_and_a_clip_no_place_for_its_events(clip, tmp_path, caplog):
    folder, _ = clip
    for out in (tmp_path, folder):
        with pytest.raises(SystemExit):
            run(folder, out, "frames_per_second=30")
        assert f"a file to write at {out}, got a folder; set out" in caplog.messages[-1]


@pytest.mark.parametrize(
    ("times", "said"),
    [
        (range(-10_000, 190_000, 10_000), "zero or more, got -10000 us .*; add 10000 to every"),
        (range(0, 20 * 5 * 10**9, 5 * 10**9), "at most a day, .* got 95000000000 us"),
        ([*range(2**32 - 19, 2**32), 5], "unwrap the clock"),
    ],
)
def test_times_that_no_file_can_hold_are_refused_before_the_work(
    clip, tmp_path, caplog, times, said
):
    folder, _ = clip
    (tmp_path / "timestamps.txt").write_text("\n".join(map(str, times)))
    with pytest.raises(SystemExit):
        run(folder, tmp_path / "events.h5")
    assert re.search(said, caplog.messages[-1])
    assert list(tmp_path.glob("events*")) == []


def test_floating_images_say_what_is_white(clip, tmp_path, caplog):
    folder, frames = clip
    plain = tmp_path / "plain.h5"
    run(folder, plain, "frames_per_second=30")
    for index, frame in enumerate(frames):
        (folder / f"{index:03d}.png").unlink()
        Image.fromarray(frame.astype(np.float32) / 255).save(folder / f"{index:03d}.tif")
    with pytest.raises(SystemExit):
        run(folder, tmp_path / "float.h5", "frames_per_second=30")
    assert "set white=1" in caplog.messages[-1]
    run(folder, tmp_path / "float.h5", "frames_per_second=30", "white=1")
    # Rounded thirds of a level aside, the events are those of the bytes.
    assert len(Events.load(tmp_path / "float.h5")) == pytest.approx(
        len(Events.load(plain)), rel=0.01
    )
