"""Frames come in the order of their numbers, or not at all."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from eqs.frames import by_name, image_paths
from eqs.frames.order import frame_order


def ordered(*names: str) -> list[str]:
    return [path.name for path in frame_order(map(Path, names))]


@pytest.mark.parametrize(
    "names",
    [
        ["frame_1.png", "frame_2.png", "frame_10.png", "frame_100.png"],
        ["0001.png", "0002.jpg", "0010.png"],
        ["a.png", "b.png", "c.png"],
        ["cam0_frame9.tif", "cam0_frame10.tif"],
        ["0.0333.png", "0.1000.png", "0.1333.png"],
        ["1600000000000000001.png", "1600000000000000002.png"],
        ["9.5.png", "10.5.png"],
        ["first.png", "first2.png"],
    ],
)
def test_numbers_count_as_people_count(names):
    assert ordered(*reversed(names)) == names


@pytest.mark.parametrize(
    "names",
    [
        ["1.png", "01.png"],
        ["1.png", "1.jpg"],
        ["left_1.png", "left_2.png", "right_1.png", "right_2.png"],
        ["b1.png", "a2.png"],
        ["1.5.png", "1.25.png"],
        ["A.png", "a.png"],
    ],
)
def test_names_that_admit_two_orders_are_refused(names):
    with pytest.raises(ValueError, match=r"whose names admit one order in .*, got .*; number them"):
        ordered(*names)


@given(st.lists(st.integers(0, 10**6), unique=True, min_size=1))
def test_any_numbers_are_sorted(numbers):
    names = [f"f{number}.png" for number in numbers]
    assert ordered(*names) == [f"f{number}.png" for number in sorted(numbers)]


def test_folders_are_listed_that_way(tmp_path):
    for name in ("f10.png", "f2.JPG", "note.txt"):
        (tmp_path / name).write_text("")
    assert [path.name for path in image_paths(tmp_path)] == ["f2.JPG", "f10.png"]
    assert [path.name for path in by_name([Path("s10"), Path("s9")])] == ["s9", "s10"]


def test_a_recording_reads_its_frames_that_way(tmp_path, make_recording):
    from eqs.data import Recording

    folder = make_recording(tmp_path / "a", frames=12)
    frames = sorted((folder / "images/left/distorted").iterdir())
    stored = [np.asarray(Image.open(path)) for path in frames]
    for number, path in enumerate(frames):
        path.rename(path.with_name(f"frame_{number}.bmp"))
    recording = Recording.load(folder)
    for number, frame in enumerate(stored):
        Image.fromarray(frame).save(recording.frame_paths[number])
        assert recording.frame_paths[number].name == f"frame_{number}.bmp"
        np.testing.assert_array_equal(recording.read_frame(number), frame)
