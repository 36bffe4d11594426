"""Files of other programs with frames become recordings that everything else can read."""

import zipfile

import h5py
import numpy as np
import pytest
from event_files import (
    HEIGHT,
    SIZE,
    WIDTH,
    aedat4,
    evt3,
    image,
    in_halves,
    mvsec,
    packet,
    rows,
    text,
    write_bag,
)
from PIL import Image

from eqs.commands.convert import main as convert
from eqs.data import Recording, RecordingFolder
from eqs.events import EventReader, Events

TIMES = [1_000_100, 1_033_400, 1_066_700]
COLOURED = {"l.aedat4", "bgr8.bag", "rgb8.mcap"}


@pytest.fixture(scope="module")
def events():
    generator = np.random.default_rng(0)
    t = 1_000_000 + np.sort(generator.integers(0, 90_000, 400))
    x, y, p = (generator.integers(0, high, 400) for high in (WIDTH, HEIGHT, 2))
    return Events.from_arrays(t, x, y, p, **SIZE)


@pytest.fixture(scope="module")
def pictures():
    """Three pictures in colour."""
    generator = np.random.default_rng(1)
    return generator.integers(0, 256, (3, HEIGHT, WIDTH, 3)).astype(np.uint8)


def written(folder, name, events, pictures):
    """A file with events and frames, grey ones the first channel of those in colour."""
    path, grey = folder / name, pictures[..., 0]
    encoding = path.stem
    if name == "l.aedat4":
        frames = [(t, t - 50, t + 51, each) for t, each in zip(TIMES, pictures, strict=True)]
        path.write_bytes(aedat4(events, frames))
    elif path.suffix in (".bag", ".db3", ".mcap"):
        ros1, coloured = path.suffix == ".bag", encoding in ("bgr8", "rgb8")
        shown = pictures if coloured else grey
        shown = shown[..., ::-1] if encoding == "bgr8" else shown
        messages = in_halves(events, ros1) + [
            ("/image", "sensor_msgs/msg/Image", t * 1000, image(each, encoding, t, ros1, padding=3))
            for t, each in zip(TIMES, shown, strict=True)
        ]
        write_bag(path, messages)
    elif name in ("rpg", "r.zip"):
        listed = folder / f"{name}_listed"
        (listed / "images").mkdir(parents=True)
        (listed / "events.txt").write_bytes(text(events))
        lines = [f"{t / 1e6:.6f} images/{t}.png\n" for t in TIMES]
        (listed / "images.txt").write_text("".join(lines))
        for t, each in zip(TIMES, grey, strict=True):
            Image.fromarray(each).save(listed / "images" / f"{t}.png")
        if name == "rpg":
            return listed
        with zipfile.ZipFile(path, "w") as archive:
            for each in listed.rglob("*.*"):
                archive.write(each, f"scene/{each.relative_to(listed)}")
    else:
        with h5py.File(path, "w") as file:
            if name == "mvsec.hdf5":
                file["davis/left/events"] = mvsec(events)
                file["davis/left/image_raw"] = grey
                file["davis/left/image_raw_ts"] = np.array(TIMES) / 1e6
            else:
                file["events"] = rows(events).astype(np.uint32)
                file["frame"], file["frame_ts"] = grey, np.array(TIMES, np.uint32)
    return path


SOURCES = [
    "l.aedat4", "mono8.bag", "8UC1.db3", "bgr8.bag", "rgb8.mcap", "rpg", "r.zip", "mvsec.hdf5",
    "v2e.h5",
]  # fmt: skip


@pytest.mark.parametrize("name", SOURCES)
def test_events_and_frames_become_a_recording(tmp_path, events, pictures, name, capsys):
    source = written(tmp_path, name, events, pictures)
    out = tmp_path / "recordings" / "scene"
    convert([str(source), str(out)], "eqs convert")
    said = capsys.readouterr().out
    assert said.startswith(f"{out}: 400 events of ")
    assert said.endswith(", 3 frames\n")
    found = Recording.load(out)
    assert (found.height, found.width) == (HEIGHT, WIDTH)
    assert found.frame_times_us.tolist() == TIMES
    expected = pictures if name in COLOURED else pictures[..., 0]
    for index in range(3):
        np.testing.assert_array_equal(found.read_frame(index), expected[index])
    with EventReader(found.events_path) as reader:
        np.testing.assert_array_equal(rows(reader.read()), rows(events))
    if name == "l.aedat4":
        assert found.exposures_us.tolist() == [[t - 50, t + 51] for t in TIMES]
    else:
        assert found.exposures_us is None
    # The file alone leaves the frames out and says so.
    convert([str(source), str(tmp_path / "alone.h5")], "eqs convert")
    assert "; its frames were left out, a name without .h5 takes them" in capsys.readouterr().out
    np.testing.assert_array_equal(rows(Events.load(tmp_path / "alone.h5", **SIZE)), rows(events))


def test_a_file_without_frames_becomes_a_recording_of_events(tmp_path, events, capsys):
    (tmp_path / "a.raw").write_bytes(evt3(events))
    convert([str(tmp_path / "a.raw"), str(tmp_path / "scene")], "eqs convert")
    assert capsys.readouterr().out.endswith("; it has no frames of the sensor's own pixels\n")
    assert not Recording.load(tmp_path / "scene", HEIGHT, WIDTH).has_frames


def ends(source, out, said, *more):
    with pytest.raises(SystemExit) as stop:
        convert([str(source), str(out), *more], "eqs convert")
    assert said in str(stop.value)
    assert [each.name for each in out.parent.iterdir() if out.name in each.name] == []


def test_frames_of_another_clock_or_size_are_refused_and_nothing_is_left(
    tmp_path, events, pictures
):
    words = evt3(events.shifted(-900_000))
    words = words[words.index(b"% end\n") + 6 :]
    kind = "event_camera_msgs/msg/EventPacket"
    messages = [("/events", kind, 1000, packet(b"evt3", words, True, **SIZE))]
    messages += [
        ("/image", "sensor_msgs/msg/Image", t, image(each, "rgb8", t, True))
        for t, each in zip(TIMES, pictures, strict=True)
    ]
    source = write_bag(tmp_path / "a.bag", messages)
    ends(source, tmp_path / "out", "got frames from 1000100 to 1066700 us and events from 100")
    source = write_bag(tmp_path / "b.bag", messages[:1] + [
        ("/image", "sensor_msgs/msg/Image", t, image(each[1:], "rgb8", t, True))
        for t, each in zip(TIMES, pictures, strict=True)
    ])  # fmt: skip
    ends(source, tmp_path / "out", "Expected frames of the sensor's 64x48 pixels")
    twice = [messages[0], messages[1], messages[1]]
    source = write_bag(tmp_path / "c.bag", twice)
    ends(source, tmp_path / "out", "sort the frames by time and drop repeated ones (the frames of")
    source = write_bag(tmp_path / "d.bag", messages[:2])
    ends(source, tmp_path / "out", "Expected at least two frames, got one")
    other = ("/other", "sensor_msgs/msg/Image", 9, image(pictures[0], "rgb8", 9, True))
    source = write_bag(tmp_path / "e.bag", [*messages, other])
    ends(source, tmp_path / "out", "Expected one topic of frames")
    odd = ("/image", "sensor_msgs/msg/Image", 9, image(pictures[0], "bayer_rggb8", 9, True))
    source = write_bag(tmp_path / "f.bag", [messages[0], odd])
    ends(source, tmp_path / "out", "Expected frames of mono8, 8UC1, mono16, 16UC1, rgb8")


def test_converted_recordings_are_a_data_set(tmp_path, events, pictures):
    for name in ("l.aedat4", "mono8.bag"):
        source = written(tmp_path, name, events, pictures)
        convert([str(source), str(tmp_path / "root" / source.stem)], "eqs convert")
    found = RecordingFolder(name="recordings", root=tmp_path / "root", converted=tmp_path / "kept")
    assert [each.name for each in found.recordings()] == ["l", "mono8"]
