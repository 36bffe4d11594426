"""Clips as folders of images."""

import numpy as np
import pytest
from PIL import Image

from eqs.frames import FrameFolder, read_image


def write_clip(folder, count=5, shape=(6, 8)):
    frames = np.random.default_rng(0).integers(0, 256, (count, *shape)).astype(np.uint8)
    for index, frame in enumerate(frames):
        Image.fromarray(frame).save(folder / f"{index:06d}.png")
    return frames


@pytest.mark.parametrize("shape", [(6, 8), (6, 8, 3)])
@pytest.mark.parametrize("chunk", [1, 2, 5, 9])
def test_chunks_join_to_the_clip(tmp_path, shape, chunk):
    frames = write_clip(tmp_path, shape=shape)
    times = np.arange(5) * 10
    parts = list(FrameFolder(tmp_path, times, chunk=chunk))
    assert max(len(part) for part, _ in parts) <= chunk
    np.testing.assert_array_equal(np.concatenate([part for part, _ in parts]), frames)
    np.testing.assert_array_equal(np.concatenate([part for _, part in parts]), times)


def test_other_files_are_no_frames(tmp_path):
    write_clip(tmp_path)
    (tmp_path / "timestamps.txt").write_text("0\n")
    assert len(FrameFolder(tmp_path, np.arange(5))) == 5


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"Expected a folder of frames, got .*nowhere"):
        FrameFolder(tmp_path / "nowhere", np.arange(3))


def test_a_folder_without_images_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match="Expected images"):
        FrameFolder(tmp_path, np.arange(3))


@pytest.mark.parametrize("times", [np.arange(4), np.zeros((5, 1), int)])
def test_each_image_needs_a_time(tmp_path, times):
    write_clip(tmp_path)
    with pytest.raises(ValueError, match="each of the 5 images"):
        FrameFolder(tmp_path, times)


def test_times_must_increase(tmp_path):
    write_clip(tmp_path)
    with pytest.raises(ValueError, match="3 us after 4 us at frame 3"):
        FrameFolder(tmp_path, [0, 1, 4, 3, 5])


def test_chunks_need_a_frame(tmp_path):
    write_clip(tmp_path)
    with pytest.raises(ValueError, match="at least one frame per chunk"):
        FrameFolder(tmp_path, np.arange(5), chunk=0)


def test_sizes_must_agree(tmp_path):
    write_clip(tmp_path)
    Image.fromarray(np.zeros((6, 9), np.uint8)).save(tmp_path / "000003.png")
    with pytest.raises(ValueError, match=r"\(6, 9\) of uint8 in .*000003.png"):
        list(FrameFolder(tmp_path, np.arange(5), chunk=1))


@pytest.mark.parametrize("content", [b"", b"\x89PNG\r\n\x1a\nbroken"])
def test_an_unreadable_image_is_named(tmp_path, content):
    path = tmp_path / "broken.png"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"readable image, got .*broken\.png"):
        read_image(path)


def test_a_truncated_image_is_named(tmp_path):
    write_clip(tmp_path, count=1, shape=(64, 64))
    path = tmp_path / "000000.png"
    path.write_bytes(path.read_bytes()[:-600])
    with pytest.raises(ValueError, match="readable image"):
        read_image(path)
