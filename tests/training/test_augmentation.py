"""Mirroring and zooming move boxes and pixels alike."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eqs.training import Augmentation, View

HEIGHT, WIDTH = 48, 64
GOLDEN = Path(__file__).parents[1] / "golden" / "rvt" / "zoom.npz"


def golden_views():
    for key, (x, y, factor) in json.loads(str(np.load(GOLDEN)["parameters"])).items():
        size = {"rows": int(HEIGHT / factor), "columns": int(WIDTH / factor)}
        view = View(inwards="in" in key, x=int(x), y=int(y), **size)
        yield pytest.param(key, view, id=key)
    yield pytest.param("taug_flip", View(flip=True, rows=HEIGHT, columns=WIDTH), id="taug_flip")


@pytest.mark.parametrize(("key", "view"), list(golden_views()))
def test_pictures_equal_the_published_program(key, view):
    stored = np.load(GOLDEN)
    np.testing.assert_array_equal(view.picture(stored["taug_in"]), stored[key])


views = st.builds(
    lambda flip, inwards, rows, columns, across, down: View(
        flip=flip,
        inwards=inwards,
        rows=rows,
        columns=columns,
        x=int(across * (WIDTH - columns)),
        y=int(down * (HEIGHT - rows)),
    ),
    st.booleans(),
    st.booleans(),
    st.integers(32, HEIGHT),
    st.integers(43, WIDTH),
    st.floats(0, 1),
    st.floats(0, 1),
)


@settings(max_examples=100, deadline=None)
@given(
    view=views,
    left=st.integers(0, 50),
    top=st.integers(0, 40),
    width=st.integers(3, 30),
    height=st.integers(3, 30),
)
def test_box_follows_the_pixels_it_covers(view, left, top, width, height):
    right, bottom = min(left + width, WIDTH), min(top + height, HEIGHT)
    frame = np.zeros((1, HEIGHT, WIDTH), np.uint8)
    frame[:, top:bottom, left:right] = 1
    box = view.boxes(np.array([[left, top, right, bottom]], np.float32), HEIGHT, WIDTH)[0]
    rows, columns = np.nonzero(view.picture(frame)[0])
    sides = box[2:] - box[:2]
    if len(rows) == 0:
        assert sides.min() <= 1  # less than a pixel may fall between the samples
        return
    found = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
    # Nearest sampling moves an edge by half a source pixel, which zooming in by 1.5 enlarges.
    np.testing.assert_allclose(box, found, atol=0.76)


def test_no_zoom_no_flip_changes_nothing():
    frames = np.random.default_rng(0).integers(0, 255, (2, 3, HEIGHT, WIDTH)).astype(np.uint8)
    view = View(rows=HEIGHT, columns=WIDTH)
    boxes = np.array([[3, 4, 9, 11]], np.float32)
    np.testing.assert_array_equal(view.picture(frames), frames)
    np.testing.assert_array_equal(view.boxes(boxes, HEIGHT, WIDTH), boxes)


def test_flip_twice_is_nothing():
    frames = np.random.default_rng(0).integers(0, 255, (2, HEIGHT, WIDTH)).astype(np.uint8)
    view = View(flip=True, rows=HEIGHT, columns=WIDTH)
    np.testing.assert_array_equal(view.picture(view.picture(frames)), frames)
    boxes = np.array([[3, 4, 9, 11], [0, 0, 64, 48]], np.float32)
    np.testing.assert_array_equal(
        view.boxes(view.boxes(boxes, HEIGHT, WIDTH), HEIGHT, WIDTH), boxes
    )


def draws(count=800, boxes=None, *, stream=False, **options):
    boxes = np.zeros((0, 4), np.float32) if boxes is None else boxes
    augmentation = Augmentation(**options)
    return [
        augmentation.draw(np.random.default_rng(seed), boxes, HEIGHT, WIDTH, stream=stream)
        for seed in range(count)
    ]


def test_frequencies():
    random = draws()
    zoomed = [view for view in random if view.rows < HEIGHT or view.columns < WIDTH]
    assert np.mean([view.flip for view in random]) == pytest.approx(0.5, abs=0.07)
    assert len(zoomed) / 800 == pytest.approx(0.8, abs=0.06)
    assert np.mean([view.inwards for view in zoomed]) == pytest.approx(0.8, abs=0.06)
    assert min(view.rows for view in random) >= int(HEIGHT / 1.5)
    assert min(view.rows for view in zoomed if not view.inwards) >= int(HEIGHT / 1.2)


def test_stream_samples_never_zoom_in():
    stream = draws(stream=True)
    assert not any(view.inwards for view in stream)
    assert 0.4 < np.mean([view.rows < HEIGHT for view in stream]) < 0.6


def test_zooming_in_shows_one_box_whole():
    boxes = np.array([[1, 2, 12, 14], [50, 30, 63, 47]], np.float32)
    options = {"zoom_probability": 1.0, "zoom_in_share": 1.0}
    chosen = set()
    for view in draws(300, boxes, **options):
        scale = np.array([view.columns / WIDTH, view.rows / HEIGHT])
        flipped = View(flip=view.flip, rows=HEIGHT, columns=WIDTH).boxes(boxes, HEIGHT, WIDTH)
        sides = (flipped[:, 2:] - flipped[:, :2]) / scale
        seen = view.boxes(boxes, HEIGHT, WIDTH)
        whole = np.all(np.abs(seen[:, 2:] - seen[:, :2] - sides) < 1e-3, axis=1)
        assert whole.any()
        chosen |= {int(index) for index in np.flatnonzero(whole)}
    assert chosen == {0, 1}  # every box is picked, the last one too


def test_zooming_in_on_a_box_larger_than_the_part():
    boxes = np.array([[0, 0, 64, 48]], np.float32)
    for view in draws(50, boxes, zoom_probability=1.0, zoom_in_share=1.0):
        assert 0 <= view.x <= WIDTH - view.columns
        assert 0 <= view.y <= HEIGHT - view.rows


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"flip_probability": 2}, r"flip_probability from 0 to 1, got 2; set datamodule\.augm"),
        ({"zoom_in_share": -0.1}, "zoom_in_share from 0 to 1, got -0.1"),
        ({"most_zoom_out": 0.5}, "most_zoom_out from 1 to inf, got 0.5"),
        ({"most_zoom_in": float("nan")}, "most_zoom_in from 1 to inf, got nan"),
    ],
)
def test_impossible_choices_are_refused(choice, message):
    with pytest.raises(ValueError, match=message):
        Augmentation(**choice)
