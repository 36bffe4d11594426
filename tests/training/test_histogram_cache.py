"""A stored histogram is whole, or an error says what to delete."""

import multiprocessing
from functools import partial

import h5py
import numpy as np
import pytest

from eqs.training.histogram_cache import cached_histogram

SHAPE = (20, 24, 32)


def counts():
    return np.random.default_rng(0).integers(0, 11, SHAPE).astype(np.uint8)


def test_what_is_read_is_what_was_made(tmp_path):
    path = tmp_path / "new" / "folder" / "7.h5"
    made = cached_histogram(path, counts, SHAPE)
    read = cached_histogram(path, partial(pytest.fail, "made again"), SHAPE)
    assert read.dtype == np.uint8
    np.testing.assert_array_equal(read, made)
    assert [each.name for each in path.parent.iterdir()] == ["7.h5"]


def test_silence_takes_little_room(tmp_path):
    path = tmp_path / "0.h5"
    cached_histogram(path, partial(np.zeros, (20, 480, 640), np.uint8), (20, 480, 640))
    assert path.stat().st_size < 20 * 480 * 640 / 50


def ask(path):
    return cached_histogram(path, counts, SHAPE).sum()


def test_processes_that_miss_the_same_histogram_do_not_disturb_each_other(tmp_path):
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        sums = pool.map(ask, [tmp_path / f"{number // 4}.h5" for number in range(40)], chunksize=1)
    assert set(sums) == {counts().sum()}
    assert len(list(tmp_path.iterdir())) == 10


@pytest.mark.parametrize("damage", ["short", "text", "other", "type"])
def test_a_damaged_file_is_named(tmp_path, damage):
    path = tmp_path / "7.h5"
    cached_histogram(path, counts, SHAPE)
    if damage == "short":
        path.write_bytes(path.read_bytes()[:3000])
    elif damage == "text":
        path.write_text("no histogram")
    else:
        with h5py.File(path, "w") as file:
            kinds = {"other": np.zeros((1, 2, 3), np.uint8), "type": np.zeros(SHAPE)}
            file["histogram"] = kinds[damage]
    with pytest.raises(ValueError, match=r"Expected a .*histogram.*7\.h5.*delete the file$"):
        cached_histogram(path, counts, SHAPE)


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "taken").write_text("a file where the folder should be")
    with pytest.raises(OSError, match=r"store a histogram at .*set datamodule\.histogram_cache"):
        cached_histogram(tmp_path / "taken" / "7.h5", counts, SHAPE)
