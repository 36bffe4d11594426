"""The three layouts of DSEC hold the same recordings; what is ambiguous or packed is said."""

import shutil

import pytest
from dsec_sequences import LAYOUTS, bare

from eqs.data import DSECFolder, Recording
from eqs.data.places import find_sequences

NAMES = {"train": ["interlaken_00_c", "zurich_city_16_a"], "test": ["thun_01_a"]}
SPLITS = {"train": ["interlaken_00_c"], "val": ["zurich_city_16_a"], "test": ["thun_01_a"]}


@pytest.fixture
def tree(tmp_path, make_recording):
    for split, names in NAMES.items():
        for seed, name in enumerate(names):
            make_recording(tmp_path / "tree" / split / name, seed=seed, frames=3)
    return tmp_path / "tree"


@pytest.mark.parametrize("layout", LAYOUTS, ids=lambda each: each.__name__)
@pytest.mark.parametrize("kind", ["remapped", "rectified"])
def test_every_layout_holds_the_same(tmp_path, tree, layout, kind):
    if kind == "rectified":
        for sequence in tree.glob("*/*"):
            bare(sequence)
    expected = DSECFolder(name="dsec", root=tree, size="32x24", splits=SPLITS)
    found = DSECFolder(
        name="dsec", root=layout(tree, tmp_path / "there"), size="32x24", splits=SPLITS
    )
    for split in SPLITS:
        (one,), (other,) = expected.recordings(split), found.recordings(split)
        assert one.content_hash() == other.content_hash()
        assert (one.name, one.has_frames) == (other.name, other.has_frames)
        assert (one.tracks == other.tracks).all()
        assert (one.exposures_us == other.exposures_us).all()
        assert len(find_sequences(tmp_path / "there")) == 3


def test_labels_that_were_unpacked_elsewhere_are_found(tmp_path, tree):
    labels = tree / "train/interlaken_00_c/object_detections"
    elsewhere = tree / "detection/train_object_detections/interlaken_00_c"
    elsewhere.mkdir(parents=True)
    labels.rename(elsewhere / "object_detections")
    assert Recording.at(find_sequences(tree)["interlaken_00_c"], 24, 32).has_labels


def test_the_same_part_twice(tmp_path, tree):
    shutil.copytree(tree / "train/interlaken_00_c/events", tree / "events/interlaken_00_c/events")
    with pytest.raises(ValueError, match=r"each sequence once .*got interlaken_00_c in .*events"):
        find_sequences(tree)


def test_archives_and_a_sequence_as_root(tmp_path, tree):
    (tmp_path / "packed").mkdir()
    (tmp_path / "packed/train_events.zip").touch()
    with pytest.raises(ValueError, match=r"found 1 archives; unpack each into a folder of its own"):
        find_sequences(tmp_path / "packed")
    with pytest.raises(ValueError, match=r"got a sequence; set data\.root to .*train$"):
        find_sequences(tree / "train/interlaken_00_c")


def test_a_name_that_ends_like_a_download_is_none(tmp_path, tree):
    """`train_calibration` is an archive's folder, not the calibration of a sequence `train`."""
    for split in NAMES:
        (tree / f"{split}_calibration").mkdir()
    assert set(find_sequences(tree)) == {name for each in NAMES.values() for name in each}
