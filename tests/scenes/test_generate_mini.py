import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from omegaconf import OmegaConf
from PIL import Image

from eqs.events import EventReader
from eqs.scenes import DSECMini, SequencePlan

CONFIG = Path(__file__).parents[2] / "eqs/configs/data/dsec_mini.yaml"
TINY = DSECMini(size="32x24", sequences={"train": 2, "test": 1}, frames=4, workers=1)


def files_of(root):
    return {
        path.relative_to(root): path
        for path in sorted(root.rglob("*"))
        if path.is_file() and path.suffix != ".h5"
    }


def same_data(one, other):
    if set(files_of(one)) != set(files_of(other)):
        return False
    for name, path in files_of(one).items():
        if path.read_bytes() != (other / name).read_bytes():
            return False
    for path in one.rglob("*.h5"):
        with EventReader(path) as a, EventReader(other / path.relative_to(one)) as b:
            first, second = a.read(), b.read()
        if any(not np.array_equal(getattr(first, k), getattr(second, k)) for k in "txyp"):
            return False
    return True


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    return TINY.generate(tmp_path_factory.mktemp("mini"))


def test_layout_is_that_of_dsec(root):
    folder = root / "train/mini_train_000_day"
    stamps = np.loadtxt(folder / "images/timestamps.txt", dtype=np.int64)
    exposures = np.loadtxt(
        folder / "images/left/exposure_timestamps.txt", dtype=np.int64, delimiter=","
    )
    frames = sorted((folder / "images/left/distorted").iterdir())
    assert (np.diff(stamps) == 50_000).all()
    assert [path.name for path in frames] == [f"{k:06d}.png" for k in range(4)]
    np.testing.assert_array_equal(exposures.mean(1), stamps)
    with Image.open(frames[0]) as image:
        assert (image.mode, image.size) == ("L", (32, 24))
    with EventReader(folder / "events/left/events.h5") as reader:
        assert (reader.height, reader.width) == (24, 32)
        assert reader.start_us < stamps[0]
        assert reader.stop_us > stamps[-1]
        assert stamps[0] > 1e10


def test_labels_lie_on_frames_and_in_the_picture(root):
    rows = 0
    for path in root.rglob("tracks.npy"):
        tracks = np.load(path)
        stamps = np.loadtxt(path.parents[2] / "images/timestamps.txt", dtype=np.int64)
        rows += len(tracks)
        assert np.isin(tracks["t"].astype(np.int64), stamps).all()
        assert (np.diff(tracks["t"].astype(np.int64)) >= 0).all()
        assert tracks.dtype.names[:8] == (
            "t",
            "x",
            "y",
            "w",
            "h",
            "class_id",
            "class_confidence",
            "track_id",
        )
    assert rows > 0


def test_manifest_tells_what_was_made(root):
    manifest = json.loads((root / "manifest.json").read_text())
    assert manifest["sensor_hash"] == TINY.sensor.definition_hash()
    assert [entry["name"] for entry in manifest["sequences"]] == [
        "mini_test_000_day",
        "mini_train_000_day",
        "mini_train_001_night",
    ]
    for entry in manifest["sequences"]:
        path = next(root.glob(f"*/{entry['name']}/events/left/events.h5"))
        with EventReader(path) as reader:
            events = reader.read()
        assert len(events) == entry["events"]
        assert int(events.p.sum()) == entry["on_events"]


def test_two_workers_make_the_same_files(root, tmp_path):
    assert same_data(root, replace(TINY, workers=2).generate(tmp_path))


def test_generation_resumes_after_an_interruption(root, tmp_path, monkeypatch):
    write = SequencePlan.write
    done = []

    def interrupted(self, folder):
        if len(done) == 1:
            (folder / self.split / (self.name + ".partial") / "events").mkdir(parents=True)
            raise KeyboardInterrupt
        done.append(self.name)
        return write(self, folder)

    monkeypatch.setattr(SequencePlan, "write", interrupted)
    with pytest.raises(KeyboardInterrupt):
        TINY.generate(tmp_path)
    assert not (tmp_path / "manifest.json").exists()
    monkeypatch.setattr(SequencePlan, "write", write)

    rendered = []
    render = SequencePlan._render
    monkeypatch.setattr(
        SequencePlan,
        "_render",
        lambda self, folder: (rendered.append(self.name), render(self, folder))[1],
    )
    TINY.generate(tmp_path)
    assert done[0] not in rendered
    assert len(rendered) == 2
    assert same_data(root, tmp_path)


def test_nothing_is_rendered_twice(root, monkeypatch):
    def fail(self, folder):
        raise AssertionError("rendered again")

    monkeypatch.setattr(SequencePlan, "_render", fail)
    assert TINY.generate(root) == root


def test_another_seed_makes_other_recordings(root, tmp_path):
    other = replace(TINY, sequences={"train": 1}, seed=1).generate(tmp_path)
    name = "train/mini_train_000_day/images/left/distorted/000002.png"
    assert (root / name).read_bytes() != (other / name).read_bytes()


def test_a_changed_parameter_replaces_the_old_recordings(tmp_path):
    one = replace(TINY, sequences={"train": 1})
    one.generate(tmp_path)
    replace(one, frames=3).generate(tmp_path)
    assert len(list(tmp_path.rglob("*.png"))) == 3


def test_recordings_of_an_earlier_plan_leave(tmp_path):
    short = replace(TINY, sequences={"train": 2}, frames=2)
    short.generate(tmp_path)
    (tmp_path / "notes.txt").write_text("mine")
    replace(short, sequences={"train": 1}).generate(tmp_path)
    assert [path.name for path in (tmp_path / "train").iterdir()] == ["mini_train_000_day"]
    assert (tmp_path / "notes.txt").exists()


def test_at_least_a_fifth_of_each_split_is_night():
    mini = replace(TINY, sequences=dict(OmegaConf.load(CONFIG).generator.sequences))
    for split, count in mini.sequences.items():
        nights = [r.night for r in mini.recordings() if r.split == split]
        assert sum(nights) >= 0.2 * count


@pytest.mark.parametrize("size", ["128", "axb", "0x96", "128x"])
def test_impossible_sizes_are_refused(size):
    with pytest.raises(ValueError, match=r"like 128x96.*set data\.size"):
        replace(TINY, size=size)


def test_unknown_splits_are_refused():
    with pytest.raises(ValueError, match=r"sequences"):
        replace(TINY, sequences={"training": 3})


def test_one_frame_is_not_a_recording():
    with pytest.raises(ValueError, match="at least 2 frames, got 1"):
        replace(TINY, frames=1)


@pytest.mark.parametrize(
    "name",
    [
        "object_detections/left/tracks.npy",
        "images/timestamps.txt",
        "images/left/distorted/000002.png",
        "events/left/events.h5",
    ],
)
def test_a_deleted_file_is_noticed_and_made_again(root, tmp_path, name):
    TINY.generate(tmp_path)
    next(tmp_path.glob("train/mini_train_000*")).joinpath(name).unlink()
    TINY.generate(tmp_path)
    assert same_data(root, tmp_path)


def test_files_of_others_are_left_alone(tmp_path):
    (tmp_path / "train").mkdir()
    (tmp_path / "train/zurich.txt").write_text("mine")
    with pytest.raises(ValueError, match=r"train/zurich\.txt; set data=dsec"):
        TINY.generate(tmp_path)
    assert [path.name for path in tmp_path.rglob("*")] == ["train", "zurich.txt"]


def test_a_link_to_nothing_is_named(root, tmp_path):
    TINY.generate(tmp_path)
    folder = next(tmp_path.glob("test/mini_*"))
    folder.rename(tmp_path / "moved")
    folder.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ValueError, match=r"link to .*elsewhere"):
        TINY.generate(tmp_path)
