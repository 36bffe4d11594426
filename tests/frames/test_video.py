"""Videos as clips, on files that the tests encode themselves."""

import struct
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


def encode_planes(path, planes, pixel_format, height=6, width=8):
    """A lossless video of two equal frames with these planes."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = width, height, pixel_format
        for _ in range(2):
            frame = av.VideoFrame(width, height, pixel_format)
            for plane, values in zip(frame.planes, planes, strict=True):
                row = np.zeros((plane.height, plane.line_size // values.itemsize), values.dtype)
                row[:, :width] = values
                plane.update(row.tobytes())
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


@pytest.mark.parametrize("bits", [10, 12, 16])
def test_grey_videos_keep_their_depth(tmp_path, bits):
    most = 2**bits - 1
    values = np.linspace(0, most, 48).round().astype("<u2").reshape(6, 8)
    path = encode_planes(tmp_path / "deep.mkv", [values], f"gray{bits}le")
    images, _ = next(iter(VideoFile(path)))
    assert images.dtype == np.float32
    np.testing.assert_allclose(images[0], values * (255 / most), rtol=1e-6)
    assert images.max() == 255


def test_colour_videos_keep_their_depth(tmp_path):
    values = np.linspace(0, 1023, 48).round().astype("<u2").reshape(6, 8)
    path = encode_planes(tmp_path / "deep.mkv", [values, values, values[::-1]], "gbrp10le")
    images, _ = next(iter(VideoFile(path)))
    assert images.shape == (2, 6, 8, 3)
    assert len(np.unique(images[0, ..., 1])) == 48
    np.testing.assert_allclose(images[0, ..., 1], values * (255 / 1023), atol=0.3)
    assert images.max() == 255


def test_transparent_videos_are_refused(tmp_path):
    opaque, half = np.full((6, 8), 255, np.uint8), np.full((6, 8), 128, np.uint8)
    planes = [half, half, half]
    path = encode_planes(tmp_path / "opaque.mkv", [*planes, opaque], "yuva444p")
    assert next(iter(VideoFile(path)))[0].shape == (2, 6, 8, 3)
    path = encode_planes(tmp_path / "glass.mkv", [*planes, half], "yuva444p")
    with pytest.raises(ValueError, match=r"opaque picture, got 48 transparent pixels"):
        list(VideoFile(path))


@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
def test_a_video_is_read_upright(tmp_path, quarters):
    path = tmp_path / "clip.mp4"
    picture = np.arange(16 * 32, dtype=np.uint8).reshape(16, 32)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 32, 16, "gray"
        frame = av.VideoFrame.from_ndarray(picture, format="gray")
        container.mux(stream.encode(frame))
        container.mux(stream.encode())
    turns = [(1, 0, 0, 1), (0, 1, -1, 0), (-1, 0, 0, -1), (0, -1, 1, 0)]  # clockwise
    a, b, c, d = turns[quarters]
    matrix = struct.pack(">9i", a << 16, b << 16, 0, c << 16, d << 16, 0, 0, 0, 1 << 30)
    content = bytearray(path.read_bytes())
    at = content.index(b"tkhd") + 44
    content[at : at + 36] = matrix
    path.write_bytes(content)
    images, _ = next(iter(VideoFile(path)))
    np.testing.assert_array_equal(images[0], np.rot90(picture, -quarters))
