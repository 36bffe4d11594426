"""Rectified frames in the event view: made once, gone on with, made anew, and asked for by name."""

import shutil

import numpy as np
import pytest
import yaml
from dsec_sequences import LAYOUTS, bare, calibration
from PIL import Image

from eqs.data import DSECFolder, EventView, SimulatedEvents
from eqs.data.event_view import view_of
from eqs.frames import remapped
from eqs.simulators import ESIM

SPLITS = {"train": ["a"], "test": ["b"]}


@pytest.fixture
def tree(tmp_path, make_recording):
    for split, name in (("train", "a"), ("test", "b")):
        bare(make_recording(tmp_path / "tree" / split / name, frames=4))
    return tmp_path / "tree"


def folder(root, kept, **options):
    view = EventView(root=kept, workers=1)
    settings = {"name": "dsec", "size": "32x24", "splits": SPLITS, "event_view": view, **options}
    return DSECFolder(root=root, **settings)


def test_frames_are_those_that_the_event_camera_would_see(tmp_path, tree):
    data = folder(tree, tmp_path / "kept")
    data.make_frames()
    (recording,) = data.recordings("train")
    view = view_of(tree / "train/a/calibration/cam_to_cam.yaml")
    with Image.open(tree / "train/a/images/left/rectified/000002.png") as image:
        expected = remapped(view.weights(4), np.asarray(image), (24, 32))
    assert (recording.read_frame(2) == expected).all()
    assert len(recording.frame_paths) == 4
    assert len({path.parent for path in recording.frame_paths}) == 1
    assert not (tree / "train/a/images/left/distorted").exists()


def test_every_layout_gives_equal_frames(tmp_path, tree):
    found = []
    for layout in LAYOUTS:
        place = tmp_path / layout.__name__
        data = folder(layout(tree, place), tmp_path / f"kept_{layout.__name__}")
        data.make_frames()
        found.append([each.content_hash() for each in data.all_recordings()])
    assert all(each == found[0] for each in found)


def test_a_cut_run_goes_on_and_changed_frames_are_made_anew(tmp_path, tree):
    data = folder(tree, tmp_path / "kept")
    data.make_frames()
    kept = tmp_path / "kept/a/images/left/distorted"
    (tmp_path / "kept/a/made_of.json").unlink()  # as if it had been cut
    (kept / "000003.png").unlink()
    before = (kept / "000000.png").stat().st_mtime_ns
    assert not data.recordings("train")[0].has_frames
    data.make_frames()
    assert data.recordings("train")[0].has_frames
    assert (kept / "000000.png").stat().st_mtime_ns == before
    source = tree / "train/a/images/left/rectified/000000.png"
    Image.fromarray(np.full((54, 72, 3), 77, np.uint8)).save(source)
    assert not data.recordings("train")[0].has_frames
    data.make_frames()
    assert set(np.unique(data.recordings("train")[0].read_frame(0))) <= {0, 77}


def test_frames_that_came_along_are_used(tmp_path, tree, make_recording):
    shutil.rmtree(tree / "train/a")
    make_recording(tree / "train/a")
    data = folder(tree, tmp_path / "kept")
    data.make_frames()
    assert data.recordings("train")[0].frame_paths[0].is_relative_to(tree)
    assert not (tmp_path / "kept/a").exists()


def test_a_bare_download_names_both_ways(tmp_path, tree):
    data = folder(tree, tmp_path / "kept")
    (recording,) = data.recordings("train")
    assert (recording.height, recording.width, recording.has_frames) == (24, 32, False)
    both = r"only rectified ones in .*eqs prepare data=dsec data\.root=PATH.*distorted images"
    with pytest.raises(ValueError, match=both):
        SimulatedEvents(ESIM(), tmp_path / "simulated").prepare([recording])
    (tree / "train/a/calibration/cam_to_cam.yaml").unlink()
    with pytest.raises(ValueError, match=r"no calibration/cam_to_cam\.yaml to remap them by"):
        data.recordings("train")[0].frames()
    with pytest.raises(FileNotFoundError, match=r"calibration at .*cam_to_cam\.yaml, found none"):
        data.make_frames()


def without_pose(content):
    del content["extrinsics"]["T_10"]


def another_size(content):
    content["intrinsics"]["camRect1"]["resolution"] = [100, 54]


@pytest.mark.parametrize(
    ("change", "message"),
    [(without_pose, r"calibration of DSEC .*'T_10'"), (another_size, r"8 bits and 100x54 pixels")],
)
def test_a_calibration_that_does_not_fit(tmp_path, tree, change, message):
    content = calibration()
    change(content)
    (tree / "train/a/calibration/cam_to_cam.yaml").write_text(yaml.safe_dump(content))
    with pytest.raises(ValueError, match=message):
        folder(tree, tmp_path / "kept").make_frames()


def test_the_first_frames_of_the_scored_sequences(tmp_path, tree):
    data = folder(tree, tmp_path / "kept", scored=["a", "b"], first_frames=3)
    data.make_frames()
    first, second = data.scored_recordings()
    assert (first.name, second.name) == ("a_first3", "b_first3")
    assert [len(each.frame_paths) for each in (first, second)] == [3, 3]
    assert first.frame_times_us[-1] == data.recordings("train")[0].frame_times_us[2]
    assert (first.tracks["t"] <= first.frame_times_us[-1]).all()
    assert (
        len(folder(tree, tmp_path / "kept", first_frames=99).scored_recordings()[0].frame_paths)
        == 4
    )
    with pytest.raises(ValueError, match=r"at least two frames .*set data\.first_frames"):
        folder(tree, tmp_path / "kept", first_frames=1).scored_recordings()
