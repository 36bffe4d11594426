"""Data sets of one's own: places, labels of every kind, and sentences about what is wrong."""

import json

import numpy as np
import pytest

from eqs.data import (
    ArrayLabels,
    CocoLabels,
    LabelProtocol,
    OwnDataset,
    RecordingFolder,
    YoloLabels,
)
from eqs.events.hints import Hints

EXPECTED = [(1_000_000, 4.0, 6.0, 8.0, 12.0, 3), (1_050_000, 16.0, 0.0, 4.0, 24.0, 5)]


@pytest.fixture
def place(tmp_path, make_recording, make_events):
    """Two recordings of 32x24: frames, times, events as an npz."""
    for seed, name in enumerate(("a_1", "b_1")):
        made = make_recording(tmp_path / "made" / name, frames=3, tracks=None, seed=seed)
        folder = tmp_path / "root" / name
        folder.mkdir(parents=True)
        (made / "images/left/distorted").rename(folder / "frames")
        (made / "images/timestamps.txt").rename(folder / "timestamps.txt")
        events = make_events(500, 24, 32, 1_000_000, 1_100_001, seed)
        np.savez(folder / "events.npz", t=events.t, x=events.x, y=events.y, p=events.p)
    return tmp_path / "root"


def own(place, **options):
    settings = {
        "name": "own",
        "root": place,
        "size": "32x24",
        "splits": {"train": ["a_*"], "test": ["b_*"]},
        "events": "{name}/events.npz",
        "frames": "{name}/frames",
        "frame_times": "{name}/timestamps.txt",
        "converted": place.parent / "converted",
        "hints": Hints(time_unit="us"),
    }
    return OwnDataset(**{**settings, **options})


def write_array(place, time="t"):
    dtype = [(time, "<u8"), *((n, "<f4") for n in "xywh"), ("class_id", "u1"), ("track_id", "u4")]
    for name in ("a_1", "b_1"):
        rows = np.array([(*row, 9) for row in EXPECTED], dtype)
        np.save(place / f"{name}_bbox.npy", rows)
    return ArrayLabels(path="{name}_bbox.npy")


def write_coco(place, shared=False):
    files = {}
    for name in ("a_1", "b_1"):
        prefix = f"{name}/" if shared else ""
        content = files.setdefault("all" if shared else name, {"images": [], "annotations": []})
        first = len(content["images"])
        content["images"] += [
            {"id": first + k, "file_name": f"{prefix}{k:06d}.png"} for k in range(3)
        ]
        for k, (_, x, y, w, h, number) in enumerate(EXPECTED):
            box = {"image_id": first + k, "bbox": [x, y, w, h], "category_id": number}
            content["annotations"] += [box, {**box, "category_id": 1, "iscrowd": 1}]
    for name, content in files.items():
        (place / f"{name}.json").write_text(json.dumps(content))
    return CocoLabels(path="all.json" if shared else "{name}.json")


def write_yolo(place):
    for name in ("a_1", "b_1"):
        folder = place / name / "labels"
        folder.mkdir()
        (folder / "classes.txt").write_text("car\n")
        for k, (_, x, y, w, h, number) in enumerate(EXPECTED):
            shares = (x + w / 2) / 32, (y + h / 2) / 24, w / 32, h / 24
            (folder / f"{k:06d}.txt").write_text(f"{number} " + " ".join(map(str, shares)) + "\n")
    return YoloLabels(folder="{name}/labels")


@pytest.mark.parametrize(
    "write",
    [
        write_array,
        lambda place: write_array(place, "ts"),
        write_coco,
        lambda place: write_coco(place, shared=True),
        write_yolo,
    ],
    ids=["array", "array with ts", "coco", "one coco for all", "yolo"],
)
def test_labels_of_every_kind_are_the_same_boxes(place, write):
    data = own(place, labels=write(place))
    data.prepare()
    (recording,) = data.recordings("train")
    assert [tuple(row.item()) for row in recording.tracks] == EXPECTED
    assert recording.has_frames
    assert recording.name == "a_1"
    before = recording.content_hash()
    (path, *_) = recording.label_paths
    path.write_bytes(path.read_bytes() + b" ")
    assert data.recordings("train")[0].content_hash() != before


def test_events_of_another_kind_are_converted_once(place, make_events):
    data = own(place)
    data.prepare()
    (recording,) = data.recordings("test")
    made = recording.events_path.stat().st_mtime_ns
    assert recording.events_path.is_relative_to(place.parent / "converted")
    assert data.recordings("test")[0].events_path.stat().st_mtime_ns == made
    expected = make_events(500, 24, 32, 1_000_000, 1_100_001, 1)
    from eqs.events import Events

    found = Events.load(recording.events_path)
    assert all((getattr(found, n) == getattr(expected, n)).all() for n in "txyp")
    with pytest.raises(ValueError, match="unit of the whole-numbered times"):
        own(place, hints=Hints(), converted=place.parent / "other").prepare()


def test_without_frames_the_labels_say_when(place):
    data = own(place, frames=None, frame_times=None, labels=write_array(place))
    (recording,) = data.recordings("train")
    assert recording.frame_times_us.tolist() == [1_000_000, 1_050_000]
    assert not recording.has_frames


def test_what_is_wrong_is_said(place, tmp_path):
    with pytest.raises(ValueError, match=r"place with \{name\} .*set data\.events"):
        own(place, events="events.npz")
    with pytest.raises(ValueError, match=r"frames and their times or neither"):
        own(place, frame_times=None)
    with pytest.raises(ValueError, match=r"named z_\* .*got a_1, b_1; set data\.root"):
        own(place, splits={"train": ["z_*"]}).recordings("train")
    with pytest.raises(ValueError, match=r"splits train, test, got 'val'"):
        own(place).recordings("val")
    with pytest.raises(
        ValueError, match=r"events at .*raw, found none; set data\.root or data\.events"
    ):
        own(place, events="{name}/events.raw").prepare()
    with pytest.raises(FileNotFoundError, match=r"labels at .*none\.npy, found none"):
        own(place, labels=ArrayLabels(path="{name}/none.npy")).recordings("train")
    with pytest.raises(
        FileNotFoundError, match=r"frames in .*pictures, found none; set data\.frames"
    ):
        own(place, frames="{name}/pictures").recordings("train")
    with pytest.raises(FileNotFoundError, match=r"set data\.root"):
        own(tmp_path / "nowhere").prepare()


def test_labels_that_cannot_be_read_are_said(place):
    labels = write_coco(place)
    content = json.loads((place / "a_1.json").read_text())
    for change, message in (
        ({"images": [{"id": 0, "file_name": "other.png"}]}, "COCO file .*KeyError"),
        (
            {"annotations": [{"image_id": 0, "bbox": [1, 2], "category_id": 1}]},
            "boxes of left, top",
        ),
        (
            {"annotations": [{"image_id": 0, "bbox": [1, 2, 3, float("nan")], "category_id": 1}]},
            "^Expected labels of finite numbers .*h with infinity or NaN",
        ),
    ):
        (place / "a_1.json").write_text(json.dumps({**content, **change}))
        with pytest.raises(ValueError, match=message):
            own(place, labels=labels).recordings("train")
    yolo = write_yolo(place)
    line = place / "a_1/labels/000000.txt"
    for text, message in (
        ("car 0.1 0.1 0.1 0.1", "lines of class, centre x"),
        ("1 40 20 10 10", "shares of width and height between 0 and 1"),
    ):
        line.write_text(text)
        with pytest.raises(ValueError, match=message):
            own(place, labels=yolo).recordings("train")
    line.rename(line.with_name("000099.txt"))
    with pytest.raises(
        ValueError, match=r"labels of frames of a_1, as 000000, 000001, got one of 00"
    ):
        own(place, labels=yolo).recordings("train")


def test_a_protocol_of_other_classes_is_refused(place):
    data = own(place, classes={"car": [1], "person": [0]})
    LabelProtocol(name="own", classes={"car": [1]}).require_known(data.classes)
    with pytest.raises(ValueError, match=r"classes \{'car': \[1\], .*set protocol=own"):
        LabelProtocol(name="coco", classes={"car": [2, 3]}).require_known(data.classes)
    LabelProtocol(name="coco", classes={"car": [2, 3]}).require_known(None)


def test_recordings_with_one_event_file_beside_their_frames(place, tmp_path, make_recording):
    make_recording(place / "dsec", tracks=None)
    data = RecordingFolder(
        name="recordings", root=place, converted=tmp_path / "kept", hints=Hints(time_unit="us")
    )
    data.prepare()
    assert [each.name for each in data.recordings()] == ["a_1", "b_1", "dsec"]
    assert all(each.has_frames and each.events_path.exists() for each in data.recordings())
    (place / "a_1/more.raw").touch()
    with pytest.raises(ValueError, match=r"one event file in .*a_1, got events\.npz, more\.raw"):
        data.prepare()
