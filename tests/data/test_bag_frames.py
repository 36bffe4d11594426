"""Frames out of bags, of every encoding, become a folder that simulators take."""

import cv2
import numpy as np
import pytest
from event_files import rows
from PIL import Image
from ros_bags import KINDS, compressed, image, in_packets, write

from eqs.commands.convert import main as convert
from eqs.data import Recording
from eqs.data.bag_frames import bag_frames
from eqs.events import EventReader, Events
from eqs.pipelines.simulate import open_clip

TIMES = [2_000_000, 2_033_333, 2_080_001]
RGB = np.random.default_rng(0).integers(0, 256, (3, 6, 5, 3)).astype(np.uint8)
DEEP = np.random.default_rng(1).integers(0, 65536, (3, 6, 5)).astype(np.uint16)
OPAQUE = np.full((3, 6, 5, 1), 255, np.uint8)
# What lies in the message, and the picture that it is.
ENCODED = {
    "mono8": (RGB[..., 0], RGB[..., 0]), "8UC1": (RGB[..., 0], RGB[..., 0]),
    "rgb8": (RGB, RGB), "bgr8": (RGB[..., ::-1], RGB),
    "rgba8": (np.concatenate([RGB, OPAQUE], axis=3), RGB),
    "bgra8": (np.concatenate([RGB[..., ::-1], OPAQUE], axis=3), RGB),
    "mono16": (DEEP, DEEP), "16UC1": (DEEP, DEEP),
}  # fmt: skip


def of(pictures, encoding, topic="/camera/image_raw", times=TIMES):
    def messages(store):
        for index, (time, each) in enumerate(zip(times, pictures, strict=True)):
            yield topic, 1000 + index, image(store, each, encoding, time)

    return messages


def converted(path, out, *more):
    convert([str(path), str(out), "--topic", "/camera/image_raw", *more], "eqs convert")


@pytest.mark.parametrize("encoding", ENCODED)
@pytest.mark.parametrize("kind", KINDS)
def test_every_encoding_becomes_pictures_with_their_times(tmp_path, kind, encoding, capsys):
    stored, expected = ENCODED[encoding]
    path, out = write(tmp_path, kind, of(stored, encoding)), tmp_path / "clip"
    converted(path, out)
    assert capsys.readouterr().out == f"{out}: 3 frames of /camera/image_raw\n"
    names = ["000000.png", "000001.png", "000002.png", "timestamps.txt"]
    assert sorted(each.name for each in out.iterdir()) == names
    assert (out / "timestamps.txt").read_text() == "2000000\n2033333\n2080001\n"
    for name, each in zip(names, expected, strict=False):
        with Image.open(out / name) as found:
            np.testing.assert_array_equal(np.asarray(found), each)
    clip = open_clip(out, None)
    assert clip.timestamps_us.tolist() == TIMES
    levels = clip.read(0, 3)
    scale = 255 / 65535 if expected.dtype == np.uint16 else 1
    np.testing.assert_allclose(levels, expected * scale, rtol=1e-6)


def test_numbers_of_two_bytes_may_begin_with_the_higher(tmp_path):
    def messages(store):
        message = image(store, DEEP[0].byteswap(), "mono16", 5)
        message.is_bigendian = 1
        yield "/camera", 1, message

    (found,) = bag_frames(write(tmp_path, "bag", messages))
    np.testing.assert_array_equal(found.picture, DEEP[0])


def encoded(picture, kind):
    """What a camera's driver makes of it, its colours in OpenCV's order."""
    ready = picture[..., ::-1] if picture.ndim == 3 else picture
    return cv2.imencode(f".{kind}", ready)[1].tobytes()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("what", ["png", "jpg", "grey jpg", "deep png"])
def test_compressed_frames_are_unpacked(tmp_path, kind, what):
    smooth = np.linspace(0, 255, 64 * 48 * 3).reshape(48, 64, 3).astype(np.uint8)
    picture = {"png": RGB[0], "deep png": DEEP[0], "grey jpg": smooth[..., 0]}.get(what, smooth)

    def messages(store):
        content = encoded(picture, what[-3:])
        for time in TIMES:
            yield "/camera/image_raw", time, compressed(store, content, f"any; {what}", time)

    out = tmp_path / "clip"
    converted(write(tmp_path, kind, messages), out)
    with Image.open(out / "000002.png") as found:
        array = np.asarray(found)
        assert array.dtype == picture.dtype
        assert array.shape == picture.shape
        largest = 0 if "png" in what else 6
        assert np.abs(array.astype(int) - picture).max() <= largest


def ends(path, out, said, *more):
    with pytest.raises(SystemExit) as stop:
        converted(path, out, *more)
    assert said in str(stop.value)
    assert not out.exists()


def test_what_is_no_picture_ends_in_a_sentence_and_leaves_nothing(tmp_path):
    out = tmp_path / "clip"
    stored = ENCODED["rgba8"][0].copy()
    stored[1, 2, 3, 3] = 254
    ends(write(tmp_path, "db3", of(stored, "rgba8")), out, "got 1 transparent pixels")
    ends(write(tmp_path, "mcap", of(DEEP, "32FC1")), out, "got 32FC1; convert them")

    def packed(content, said):
        def messages(store):
            yield "/camera/image_raw", 1, compressed(store, content, said, 1)

        return messages

    for name, content, said, wanted in (
        ("depth", b"abc", "16UC1; compressedDepth png", "which are distances"),
        ("odd", b"abc", "jpeg", "Expected frames as JPEG or PNG"),
        ("cut", encoded(RGB[0], "png")[:60], "png", "Expected frames as JPEG or PNG"),
    ):
        (tmp_path / name).mkdir()
        ends(write(tmp_path / name, "bag", packed(content, said)), out, wanted)


def test_times_that_do_not_increase_and_single_frames_are_refused(tmp_path):
    out = tmp_path / "clip"
    again = of(RGB, "rgb8", times=[5, 9, 9])
    ends(write(tmp_path, "bag", again), out, "got 9 us after 9 us at frame 2")
    ends(write(tmp_path, "db3", of(RGB[:1], "rgb8", times=[5])), out, "two frames, got one")
    path = write(tmp_path, "mcap", of(RGB, "rgb8"))
    ends(path, tmp_path / "a.h5", "Expected a folder for frames")
    ends(path, out, "Expected the topic /other in", "--topic", "/other")
    (tmp_path / "a.txt").write_text("1 2 3 4")
    ends(tmp_path / "a.txt", out, "Expected a bag to look for topics in")


def test_a_bag_of_frames_alone_says_how_to_get_them(tmp_path):
    path = write(tmp_path, "bag", of(RGB, "rgb8"))
    with pytest.raises(SystemExit, match=r"got /camera/image_raw \(sensor_msgs/msg/Image\); name"):
        convert([str(path), str(tmp_path / "out")], "eqs convert")


def test_events_and_frames_of_several_cameras_become_the_recording_that_is_named(tmp_path):
    generator = np.random.default_rng(2)
    t = 2_000_000 + np.sort(generator.integers(0, 90_000, 300))
    x, y, p = (generator.integers(0, high, 300) for high in (5, 6, 2))
    events = Events.from_arrays(t, x, y, p, height=6, width=5)

    def messages(store):
        yield from in_packets(events, [100])(store)
        yield from of(RGB[::-1], "rgb8", "/other")(store)
        yield from of(DEEP, "mono16")(store)

    path, out = write(tmp_path, "mcap", messages), tmp_path / "scene"
    with pytest.raises(SystemExit, match="Expected one topic of frames"):
        convert([str(path), str(out)], "eqs convert")
    converted(path, out, "--topic", "/dvs/events")
    found = Recording.load(out)
    assert found.frame_times_us.tolist() == TIMES
    np.testing.assert_allclose(found.read_frame(1), DEEP[1] / 257, rtol=1e-6)
    with EventReader(found.events_path) as reader:
        np.testing.assert_array_equal(rows(reader.read()), rows(events))
