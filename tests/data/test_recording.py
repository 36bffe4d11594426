"""Sequence folders: what is read, and which faults are named."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from eqs.data import Recording, detection_windows


def test_reads_everything(tmp_path, make_recording):
    recording = Recording.load(make_recording(tmp_path / "a", frames=4))
    assert (recording.name, recording.height, recording.width) == ("a", 24, 32)
    assert recording.frame_times_us.tolist() == [1_000_000, 1_050_000, 1_100_000, 1_150_000]
    assert recording.exposures_us.tolist()[0] == [999_500, 1_000_500]
    assert [path.name for path in recording.frame_paths][:2] == ["000000.png", "000001.png"]
    assert recording.has_frames
    assert recording.has_labels
    assert recording.events_path.is_file()
    assert recording.tracks["x"][recording.tracks["t"] == 1_050_000].tolist() == [5.0]


@pytest.mark.parametrize("colour", [False, True])
def test_frames_are_as_stored(tmp_path, make_recording, colour):
    recording = Recording.load(make_recording(tmp_path / "a", colour=colour))
    stored = np.asarray(Image.open(recording.frame_paths[2]))
    np.testing.assert_array_equal(recording.read_frame(2), stored)
    assert stored.shape == ((24, 32, 3) if colour else (24, 32))


def test_labels_are_read_by_name_and_sorted(tmp_path, make_recording, make_tracks):
    folder = make_recording(tmp_path / "a")
    tracks = make_tracks([(1_050_000, 7, 0, 9, 9, 0), (1_000_000, 3, 0, 9, 9, 2)])
    wider = np.dtype([("extra", "<U10"), *((name, "<f8") for name in tracks.dtype.names)])
    other = np.zeros(2, wider)
    for name in tracks.dtype.names:
        other[name] = tracks[name]
    np.save(folder / "object_detections/left/tracks.npy", other)
    recording = Recording.load(folder)
    assert recording.tracks["x"].tolist() == [3.0, 7.0]
    assert recording.tracks["class_id"].tolist() == [2, 0]


def test_without_labels_or_frames(tmp_path, make_recording):
    folder = make_recording(tmp_path / "a", tracks=None)
    recording = Recording.load(folder)
    assert not recording.has_labels
    shutil.rmtree(folder / "images" / "left")
    assert not Recording.load(folder, 24, 32).has_frames
    assert len(Recording.load(folder, 24, 32).frame_times_us) == 6
    with pytest.raises(ValueError, match=r"sensor size .* no frames to tell it; set data\.size"):
        Recording.load(folder)


def remove_times(folder):
    (folder / "images/timestamps.txt").unlink()


def one_time_less(folder):
    (folder / "images/timestamps.txt").write_text("1000000\n1050000\n")


def backwards(folder):
    (folder / "images/timestamps.txt").write_text("5\n4\n6\n7\n8\n9\n")


def no_numbers(folder):
    (folder / "images/timestamps.txt").write_text("0.5\n" * 6)


def one_frame(folder):
    for path in sorted((folder / "images/left/distorted").iterdir())[1:]:
        path.unlink()
    (folder / "images/timestamps.txt").write_text("1000000\n")


def broken_image(folder):
    (folder / "images/left/distorted/000000.png").write_bytes(b"no image")


def other_exposures(folder):
    (folder / "images/left/exposure_timestamps.txt").write_text("1, 2\n")


def no_tracks(folder):
    (folder / "object_detections/left/tracks.npy").write_bytes(b"\x93NUMPY")


def foreign_tracks(folder):
    np.save(folder / "object_detections/left/tracks.npy", np.zeros(3, [("t", "u8"), ("x", "f4")]))


def emptied(folder):
    shutil.rmtree(folder)
    folder.mkdir()


def no_text(folder):
    (folder / "images/timestamps.txt").write_bytes(b"\xff\x00" * 9)


def too_large(folder):
    path = folder / "images/timestamps.txt"
    path.write_text("\n".join([*path.read_text().split()[:-1], "9" * 30]))


def uneven(folder):
    path = folder / "images/timestamps.txt"
    path.write_text("0, 1\n" + path.read_text())


def square_tracks(folder):
    path = folder / "object_detections/left/tracks.npy"
    tracks = np.load(path)
    np.save(path, np.stack([tracks, tracks]))


def undefined_tracks(folder):
    path = folder / "object_detections/left/tracks.npy"
    tracks = np.load(path)
    tracks["w"][1] = np.nan
    np.save(path, tracks)


def labels_alone(folder):
    shutil.rmtree(folder / "images")


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (no_text, "whole microseconds in .*timestamps.txt"),
        (too_large, "whole microseconds in .*timestamps.txt"),
        (uneven, "whole microseconds in .*timestamps.txt"),
        (square_tracks, r"row of labels in .*shape \(2, "),
        (undefined_tracks, "finite numbers in .*tracks.npy, got w with .*NaN"),
        (labels_alone, "times of the frames of the labels .*found none; add images/timestamps.txt"),
        (remove_times, "times of 6 frames at .*timestamps.txt, found none"),
        (one_time_less, "one timestamp per frame, got 2 lines .* and 6 frames"),
        (
            backwards,
            "times that increase, got 4 us after 5 us .*sort the frames .*timestamps",
        ),
        (no_numbers, "whole microseconds in .*timestamps.txt"),
        (one_frame, "at least two frames and times .*got one"),
        (broken_image, "image at .*000000.png"),
        (other_exposures, r"6 exposures .*shape \(1, 2\)"),
        (no_tracks, "label array in .*tracks.npy"),
        (foreign_tracks, "none named y, w, h, class_id"),
        (emptied, "found neither; set data.root"),
    ],
)
def test_faults_are_named(tmp_path, make_recording, damage, message):
    folder = make_recording(tmp_path / "a")
    damage(folder)
    with pytest.raises(ValueError, match=message) as caught:
        Recording.load(folder, 24, 32)
    assert str(folder) in str(caught.value)


def test_wrong_sizes(tmp_path, make_recording):
    folder = make_recording(tmp_path / "a")
    with pytest.raises(ValueError, match=r"of 64x48 pixels, got 32x24 .*set data\.size"):
        Recording.load(folder, 48, 64)
    Image.fromarray(np.zeros((9, 9), np.uint8)).save(folder / "images/left/distorted/000003.png")
    with pytest.raises(ValueError, match=r"32x24 pixels, got 9x9 in .*000003\.png"):
        Recording.load(folder).read_frame(3)


def test_missing_folder(tmp_path):
    with pytest.raises(
        FileNotFoundError, match=r"recording at .*nothing, found none; set data\.ro"
    ):
        Recording.load(Path(tmp_path / "nothing"))


def test_windows_end_at_frames():
    times = np.array([0, 50_000, 100_001, 180_000])
    windows = detection_windows(times)
    np.testing.assert_array_equal(windows[:, 1], times[1:])
    assert set(np.diff(windows, axis=1).ravel()) == {50_000}
    assert detection_windows(times[:1]).shape == (0, 2)
