"""Which boxes count."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from eqs.data import LabelProtocol, detector_rows

CLASSES = {"pedestrian": [0], "two_wheeler": [1, 5, 6], "car": [2, 3, 4]}


def protocol(**options):
    return LabelProtocol(name="test", **{"classes": CLASSES, **options})


def select(make_tracks, rows, height=48, width=64, **options):
    boxes, labels = protocol(**options).select(
        make_tracks([(0, *row) for row in rows]), height, width
    )
    assert (boxes.dtype, labels.dtype) == (np.float32, np.int64)
    return boxes.tolist(), labels.tolist()


def test_classes_are_mapped_and_others_left_out(make_tracks):
    rows = [(0, 0, 20, 20, number) for number in range(8)]
    assert select(make_tracks, rows)[1] == [0, 1, 2, 2, 2, 1, 1]


def test_boxes_are_clipped_to_the_frame(make_tracks):
    boxes, _ = select(make_tracks, [(-5, -6, 20, 20, 0), (50, 40, 30, 30, 2)])
    assert boxes == [[0, 0, 15, 14], [50, 40, 64, 48]]


def test_boxes_outside_are_left_out(make_tracks):
    outside = [(64, 0, 9, 9, 0), (0, 48, 9, 9, 0), (-9, 0, 9, 9, 0), (5, 5, 0, 9, 0)]
    assert select(make_tracks, outside) == ([], [])


def test_crop_clips_before_sizes_are_measured(make_tracks):
    rows = [(0, 0, 10, 48, 0), (0, 35, 10, 13, 2)]
    boxes, labels = select(make_tracks, rows, crop_rows=40, min_side_px=6)
    assert (boxes, labels) == ([[0, 0, 10, 40]], [0])


def test_limits_are_inclusive_and_scale_with_the_sensor(make_tracks):
    rows = [(0, 0, 10, 10, 0), (0, 0, 9.9, 10, 0), (0, 0, 10, 30, 0)]
    assert len(select(make_tracks, rows, min_side_px=10)[1]) == 2
    assert len(select(make_tracks, rows, min_side_px=100, reference_width=640)[1]) == 2
    assert select(make_tracks, [(0, 0, 6, 8, 0)], min_diagonal_px=10)[1] == [0]
    assert select(make_tracks, [(0, 0, 6, 7.9, 0)], min_diagonal_px=10)[1] == []


def test_no_boxes(make_tracks):
    boxes, labels = protocol().select(make_tracks([]), 48, 64)
    assert boxes.shape == (0, 4)
    assert labels.shape == (0,)


def test_detector_rows():
    boxes = np.array([[0, 2, 10, 8], [4, 4, 6, 10]], np.float32)
    rows = detector_rows(boxes, np.array([2, 0]))
    assert rows.tolist() == [[2, 5, 5, 10, 6], [0, 5, 7, 2, 6]]


def test_card_tells_everything_and_can_be_stored():
    one, other = protocol(min_side_px=5).card(), protocol(min_side_px=6).card()
    assert one != other
    assert json.loads(json.dumps(one)) == one
    # The share that must belong to a frame refuses recordings and moves no number.
    assert set(one) == {*LabelProtocol.__dataclass_fields__} - {"least_matched_labels"}


def test_bad_protocols():
    with pytest.raises(ValueError, match=r"share no data set id.*set protocol\.classes"):
        protocol(classes={"car": [2], "truck": [2]})
    with pytest.raises(ValueError, match="share no data set id"):
        protocol(classes={})
    with pytest.raises(ValueError, match=r"zero or more, got -1 .*protocol\.min_side_px"):
        protocol(min_side_px=-1)
    with pytest.raises(ValueError, match=r"got -1 and 0\.9; set protocol\.label_tolerance_us"):
        protocol(label_tolerance_us=-1)
    with pytest.raises(ValueError, match=r"got 5000 and 1\.5; .*protocol\.least_matched_labels"):
        protocol(least_matched_labels=1.5)


@pytest.mark.parametrize(
    ("name", "count"), [("coco", 3), ("dsec8", 8), ("dagr", 2), ("prophesee_gen1", 2)]
)
def test_configured_protocols(name, count):
    path = Path(__file__).parents[2] / "eqs/configs" / "protocol" / f"{name}.yaml"
    config = yaml.safe_load(path.read_text())
    del config["_target_"]
    config.update(crop_rows=None, score_empty_frames=True)  # interpolations from the data set
    assert len(LabelProtocol(**config).class_names) == count
