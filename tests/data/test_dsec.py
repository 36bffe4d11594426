"""Data sets: splits by name, folders in any of DSEC's arrangements, what is missing is said."""

from fnmatch import fnmatchcase
from pathlib import Path

import pytest
import yaml

from eqs.data import DSECFolder, RecordingFolder, parse_size

SPLITS = {"train": ["train_*"], "val": ["train_b"], "test": ["test_*"]}
CONFIGS = Path(__file__).parents[2] / "eqs/configs"


def folder(root, **options):
    settings = {"name": "tiny", "size": "32x24", "splits": SPLITS, **options}
    return DSECFolder(root=root, **settings)


@pytest.mark.parametrize("arrangement", ["", "train"])
def test_finds_sequences_in_any_arrangement(tmp_path, make_recording, arrangement):
    for name in ("train_a", "train_b"):
        make_recording(tmp_path / arrangement / name)
    make_recording(tmp_path / "test" / "test_a")
    data = folder(tmp_path)
    data.prepare()
    assert [recording.name for recording in data.recordings("train")] == ["train_a", "train_b"]
    assert [recording.name for recording in data.recordings("val")] == ["train_b"]
    assert [recording.name for recording in data.recordings("test")] == ["test_a"]
    assert data.recordings("test")[0].has_labels


def test_unfinished_sequences_are_not_seen(tmp_path, make_recording):
    make_recording(tmp_path / "train_a")
    make_recording(tmp_path / "train_c.partial")
    assert [recording.name for recording in folder(tmp_path).recordings("train")] == ["train_a"]


def test_size_after_crop(tmp_path):
    assert (folder(tmp_path).height, folder(tmp_path).width) == (24, 32)
    assert folder(tmp_path, crop_rows=20).height == 20
    with pytest.raises(ValueError, match=r"data\.crop_rows between 1 and 24, got 25"):
        folder(tmp_path, crop_rows=25)


def test_missing_root_and_empty_root(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"data set at .*nowhere.*; set data\.root"):
        folder(tmp_path / "nowhere").prepare()
    with pytest.raises(ValueError, match=r"layout of DSEC below .*found none; set data\.root"):
        folder(tmp_path).prepare()


def test_no_match_and_unknown_split(tmp_path, make_recording, caplog):
    make_recording(tmp_path / "train_a")
    with pytest.raises(ValueError, match=r"named test_\* for the test split .*got train_a"):
        folder(tmp_path).recordings("test")
    with pytest.raises(ValueError, match="splits train, val, test, got 'dev'"):
        folder(tmp_path).recordings("dev")
    folder(tmp_path, splits={"train": ["train_a", "train_z"]}).prepare()
    assert "no sequence train_z" in caplog.text


def test_same_name_twice(tmp_path, make_recording):
    make_recording(tmp_path / "train_a")
    make_recording(tmp_path / "train" / "train_a")
    with pytest.raises(ValueError, match=r"each sequence once .*got train_a"):
        folder(tmp_path).prepare()


def test_sequences_of_another_size(tmp_path, make_recording):
    make_recording(tmp_path / "train_a")
    with pytest.raises(ValueError, match=r"64x48 pixels, got 32x24 .*set data\.size"):
        folder(tmp_path, size="64x48").recordings("train")


def test_generator_makes_what_is_missing(tmp_path, make_recording):
    class Generator:
        def generate(self, root):
            make_recording(root / "train" / "train_a")

        def events_file(self, root, name):
            return None

    data = folder(tmp_path / "new", generator=Generator())
    data.prepare()
    assert len(data.recordings("train")) == 1


def test_sizes_in_words():
    assert parse_size("346x260") == (260, 346)
    for wrong in ("640", "640x", "axb", "0x480", "1x2x3"):
        with pytest.raises(ValueError, match=rf"size like 640x480, got '{wrong}'"):
            parse_size(wrong)


def test_recordings_without_frames_are_named(tmp_path, make_recording, caplog):
    make_recording(tmp_path / "whole", tracks=None)
    bare = make_recording(tmp_path / "bare", tracks=None)
    for path in (bare / "images/left/distorted").iterdir():
        path.unlink()
    silent = make_recording(tmp_path / "silent", tracks=None)
    (silent / "events/left/events.h5").unlink()
    data = RecordingFolder(name="recordings", root=tmp_path, converted=tmp_path / ".converted")
    data.prepare()
    assert data.skipped == {
        "bare": "has no frames in images/left/distorted",
        "silent": "has no events in events/left/events.h5",
    }
    assert "skipped bare: has no frames" in caplog.text
    assert [recording.name for recording in data.recordings()] == ["whole"]
    with pytest.raises(ValueError, match="got 'train'; set data to a labelled data set"):
        data.recordings("train")


def test_recordings_all_without_frames(tmp_path, make_recording):
    bare = make_recording(tmp_path / "bare", tracks=None)
    for path in (bare / "images/left/distorted").iterdir():
        path.unlink()
    with pytest.raises(ValueError, match=r"got none \(bare has no frames"):
        RecordingFolder(
            name="recordings", root=tmp_path, converted=tmp_path / ".converted"
        ).prepare()


def test_official_splits():
    letters = ("ab abcdef abcde a abcdef ab a a", "a abcde ab abc a ab abc a", "a a a a a a")
    named = {
        "interlaken_00": "abcdefg",
        "interlaken_01": "a",
        "thun_00": "a",
        "thun_01": "ab",
        "thun_02": "a",
        **{f"zurich_city_{i:02d}": each for i, each in enumerate(" ".join(letters).split())},
    }
    names = [f"{town}_{letter}" for town, each in named.items() for letter in each]
    assert len(names) == 60
    splits = yaml.safe_load((CONFIGS / "data/dsec.yaml").read_text())["splits"]
    dealt = {
        split: [name for name in names if any(fnmatchcase(name, each) for each in patterns)]
        for split, patterns in splits.items()
    }
    assert {split: len(chosen) for split, chosen in dealt.items()} == {
        "train": 41,
        "val": 6,
        "test": 13,
    }
    assert len({name for chosen in dealt.values() for name in chosen}) == 60
    assert {"thun_02_a", "interlaken_00_a", "zurich_city_13_b"} < set(dealt["test"])


def test_sequences_come_by_number(tmp_path, make_recording):
    for name in ("train_10", "train_9", "train_b"):
        make_recording(tmp_path / name)
    assert [each.name for each in folder(tmp_path).recordings("train")] == [
        "train_9",
        "train_10",
        "train_b",
    ]


def test_recordings_with_frames_of_another_suffix_are_not_skipped(tmp_path, make_recording):
    path = make_recording(tmp_path / "whole", tracks=None)
    for frame in (path / "images/left/distorted").iterdir():
        frame.rename(frame.with_suffix(".BMP"))
    data = RecordingFolder(name="recordings", root=tmp_path, converted=tmp_path / ".converted")
    assert data.skipped == {}
    assert len(data.all_recordings()[0].frame_paths) == 6
