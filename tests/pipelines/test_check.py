"""One table that says of any data set whether it can be used."""

import re
from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_dir

import eqs
from eqs.events import Events
from eqs.pipelines.check import check

CONFIGS = Path(eqs.__file__).parent / "configs"
TRACKS = "object_detections/left/tracks.npy"


@pytest.fixture
def root(tmp_path, make_recording):
    for name in ("train_a", "train_b", "val_a", "test_a"):
        make_recording(tmp_path / "data" / name, frames=6)
    return tmp_path / "data"


def run(root, *overrides):
    given = [
        "data=dsec",
        f"data.root={root}",
        "data.size=32x24",
        "data.crop_rows=null",
        "data.splits={train: [train_*], val: [val_*], test: [test_*]}",
        *overrides,
    ]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        cfg = compose("check", overrides=given)
    check(cfg)


def moved_labels(folder, offset_us):
    tracks = np.load(folder / TRACKS)
    tracks["t"] += offset_us
    np.save(folder / TRACKS, tracks)


def test_a_sound_data_set_says_what_to_type_next(root, capsys):
    moved_labels(root / "val_a", 1)
    run(root)
    said = " ".join(capsys.readouterr().out.split())
    assert "all 4 recordings can be used; type python train.py sim=real data=dsec" in said
    assert "labels lie up to 1 us beside their frames (val_a)" in said


def truncated_frame(folder):
    path = folder / "images/left/distorted/000003.png"
    path.write_bytes(path.read_bytes()[:-30])


def broken_events(folder):
    path = folder / "events/left/events.h5"
    path.write_bytes(path.read_bytes()[:400])


def no_events(folder):
    Events.empty(24, 32).save(folder / "events/left/events.h5")


def other_clock(folder):
    path = folder / "images/timestamps.txt"
    path.write_text("\n".join(str(int(t) + 10**7) for t in path.read_text().split()))


def other_labels(folder):
    moved_labels(folder, 20_000)


def two_orders(folder):
    place = folder / "images/left/distorted"
    (place / "000003.png").rename(place / "0004.png")


@pytest.mark.parametrize(
    ("damage", "fault"),
    [
        (truncated_frame, "readable image, got .*000003.png"),
        (broken_events, "to be a whole HDF5 file"),
        (no_events, "Expected events in .*got none"),
        (other_clock, "events and frames of one clock"),
        (other_labels, "0 of 6 label times"),
        (two_orders, "admit one order"),
    ],
)
def test_every_fault_is_named_and_the_last_line_says_what_to_do(
    root, capsys, caplog, damage, fault
):
    damage(root / "train_b")
    with pytest.raises(SystemExit):
        run(root)
    said = " ".join(capsys.readouterr().out.split())
    assert "fault in train_b" in said
    assert re.search(fault, said)
    assert "got 1 of 4 with faults (train_b); mend what is named" in caplog.messages[-1]


def test_recordings_without_labels_are_checked_too(root, capsys):
    for folder in root.iterdir():
        (folder / TRACKS).unlink()
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        check(compose("check", overrides=["data=recordings", f"data.root={root}"]))
    assert "type python evaluate.py --eqs data=recordings" in " ".join(
        capsys.readouterr().out.split()
    )


def test_frames_that_are_not_a_window_apart_are_named(root, capsys):
    run(root, "window_us=10000")
    said = " ".join(capsys.readouterr().out.split())
    assert "frames are 50.0 ms apart and windows 10.0 ms long: 80 % of the events are not" in said
