"""Videos as clips, on files that the tests encode themselves."""

from fractions import Fraction

import av
import numpy as np
import pytest

from eqs.frames import VideoFile

TIMES_MS = [0, 40, 90, 130, 200]


def encode(path, levels, times_ms):
    """A lossless grey video whose frames have these levels and times."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 16, 8, "gray"
        stream.codec_context.time_base = Fraction(1, 1000)
        for level, time_ms in zip(levels, times_ms, strict=True):
            frame = av.VideoFrame.from_ndarray(np.full((8, 16), level, np.uint8), format="gray")
            frame.pts, frame.time_base = time_ms, Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


@pytest.mark.parametrize("chunk", [1, 2, 8])
def test_frames_and_irregular_times_come_back_in_any_chunks(tmp_path, chunk):
    path = encode(tmp_path / "clip.mkv", range(0, 250, 50), TIMES_MS)
    chunks = list(VideoFile(path, chunk=chunk))
    images = np.concatenate([images for images, _ in chunks])
    times_us = np.concatenate([times for _, times in chunks])
    assert max(len(images) for images, _ in chunks) <= chunk
    assert images.shape == (5, 8, 16)
    assert images[:, 0, 0].tolist() == [0, 50, 100, 150, 200]
    assert times_us.tolist() == [1000 * time for time in TIMES_MS]


def test_a_missing_video_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"Expected a video at .*none\.mp4, found none"):
        VideoFile(tmp_path / "none.mp4")


def test_what_is_no_video_is_refused(tmp_path):
    path = tmp_path / "clip.mp4"
    path.write_bytes(b"no video at all")
    assert len(VideoFile(path)) == 0
    with pytest.raises(ValueError, match=r"Expected .*clip\.mp4 to be a video that FFmpeg decodes"):
        next(iter(VideoFile(path)))


def test_a_truncated_video_is_refused(tmp_path):
    path = encode(tmp_path / "clip.mp4", range(0, 250, 50), TIMES_MS)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(ValueError, match="Expected"):
        list(VideoFile(path))
