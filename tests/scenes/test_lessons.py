"""Lessons: drawn from their number, whatever the others, and whole on disk."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eqs.scenes import HAND_HELD, PASSING, Lessons, ReferenceSensor
from eqs.scenes.lessons import SPREAD, moved

FEW = Lessons(
    count=2,
    held_out=1,
    windows=3,
    seed=4,
    sizes={"32x24": 1.0, "48x32": 1.0},
    street_share=0.5,
    night_share=0.5,
    manners={"hand_held": HAND_HELD, "passing": PASSING},
    sensors={"reference_sensor": ReferenceSensor()},
)


def test_a_lesson_depends_on_its_number_alone(tmp_path: Path) -> None:
    folder = FEW.prepare(tmp_path)
    more = replace(FEW, count=3)
    assert more.prepare(tmp_path) == folder
    assert len(list(folder.glob("*.npz"))) == 4
    for number in range(3):
        loaded, made = more.load(folder, number), FEW.make(number)
        np.testing.assert_array_equal(loaded.histograms, made.histograms)
        np.testing.assert_array_equal(loaded.boxes, made.boxes)
        assert made.histograms.shape[:2] == (3, 20)
        assert made.histograms.any()


def test_what_is_there_is_kept(tmp_path: Path) -> None:
    folder = FEW.prepare(tmp_path)
    before = {path.name: path.stat().st_mtime_ns for path in folder.glob("*.npz")}
    (folder / "00001.npz").unlink()
    FEW.prepare(tmp_path)
    after = {path.name: path.stat().st_mtime_ns for path in folder.glob("*.npz")}
    assert before.keys() == after.keys()
    assert [name for name in before if before[name] != after[name]] == ["00001.npz"]


def test_boxes_lie_in_the_image_at_the_end_of_a_window() -> None:
    for number in range(6):
        lesson = FEW.make(number)
        height, width = lesson.histograms.shape[-2:]
        index, _, left, top, right, bottom = lesson.boxes.T
        assert (np.diff(index) >= 0).all()
        assert ((left >= 0) & (right <= width) & (left < right)).all()
        assert ((top >= 0) & (bottom <= height) & (top < bottom)).all()
        assert set(index) <= {0, 1, 2}


def test_other_settings_have_another_hash() -> None:
    hashes = {FEW.definition_hash(), replace(FEW, count=9).definition_hash()}
    assert len(hashes) == 1
    for change in ({"seed": 5}, {"windows": 4}, {"street_share": 0.1}):
        hashes.add(replace(FEW, **change).definition_hash())
    other = {"reference_sensor": ReferenceSensor(leak_hz=0.2)}
    hashes.add(replace(FEW, sensors=other).definition_hash())
    assert len(hashes) == 5


def test_cameras_differ_about_the_one_they_stem_from() -> None:
    rng = np.random.default_rng(0)
    thresholds = [moved(rng, ReferenceSensor()).threshold_on_log for _ in range(200)]
    logs = np.log(np.array(thresholds) / ReferenceSensor().threshold_on_log)
    assert abs(logs.mean()) < 0.06
    assert logs.std() == pytest.approx(SPREAD["threshold_on_log"], rel=0.2)
    assert len({*thresholds}) == 200


def test_there_has_to_be_something_to_draw_from() -> None:
    with pytest.raises(ValueError, match="Expected sizes, manners and sensors to draw from"):
        replace(FEW, manners={})
