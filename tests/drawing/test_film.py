"""Films of event streams, read back from the files."""

import av
import numpy as np
import pytest
from PIL import Image

from eqs.drawing import Boxes, event_pictures, with_boxes, write_film
from eqs.events import EventReader, Events


@pytest.fixture
def reader(tmp_path):
    """A pixel that moves one column to the right every 10 ms."""
    columns = np.arange(10)
    events = Events.from_arrays(
        t=10_000 * columns, x=columns, y=[3] * 10, p=[1] * 10, height=7, width=11
    )
    events.save(tmp_path / "events.h5")
    with EventReader(tmp_path / "events.h5") as opened:
        yield opened


def test_each_picture_shows_the_events_before_its_instant(reader):
    shown = event_pictures(reader, start_us=0, stop_us=90_001, window_us=10_000, pictures=9)
    for index, picture in enumerate(shown):
        lit = (picture < 255).any(-1)
        assert picture.shape == (7, 11, 3)
        assert lit.sum() == 1
        assert abs(int(lit.nonzero()[1][0]) - index) <= 1


def test_a_stretch_shorter_than_a_window_is_refused(reader):
    with pytest.raises(ValueError, match="a stretch of at least a window of 33000 us"):
        next(event_pictures(reader, start_us=0, stop_us=100))


@pytest.fixture
def pictures(reader):
    return list(event_pictures(reader, start_us=0, stop_us=90_001, window_us=20_000, pictures=12))


def test_a_gif_holds_every_picture_once(tmp_path, pictures):
    write_film(tmp_path / "film.gif", pictures, frames_per_second=20, zoom=2)
    with Image.open(tmp_path / "film.gif") as film:
        assert (film.width, film.height) == (22, 14)
        durations = []
        for frame in range(film.n_frames):
            film.seek(frame)
            durations.append(film.info["duration"])
    # Equal neighbours share a frame that stays longer.
    assert sum(durations) == 50 * len(pictures)


def test_a_video_holds_every_picture(tmp_path, pictures):
    write_film(tmp_path / "film.mp4", pictures)
    with av.open(str(tmp_path / "film.mp4")) as film:
        frames = list(film.decode(video=0))
    assert len(frames) == len(pictures)
    assert (frames[0].width, frames[0].height) == (12, 8)  # made even


def test_a_strip_shows_at_most_eight(tmp_path, pictures):
    write_film(tmp_path / "strip.png", pictures)
    with Image.open(tmp_path / "strip.png") as strip:
        assert (strip.width, strip.height) == (8 * 11 + 7 * 4, 7)


def test_an_unknown_format_is_refused_and_leaves_nothing(tmp_path, pictures):
    with pytest.raises(ValueError, match=r"Expected a name that ends in \.gif, \.mp4, \.png"):
        write_film(tmp_path / "film.avi", pictures)
    assert list(tmp_path.glob("film*")) == []


def test_boxes_are_outlined_and_weak_ones_left_out():
    blank = np.full((12, 16, 3), 255, np.uint8)
    boxes = Boxes(
        corners=np.array([[2.0, 3.0, 8.0, 9.0], [9.0, 1.0, 15.0, 6.0]]),
        labels=np.array([0, 1]),
        scores=np.array([0.9, 0.1]),
    )
    marked = (with_boxes(blank, boxes) < 255).any(-1)
    expected = np.zeros((12, 16), bool)
    expected[3:9, 2:8] = True
    expected[4:8, 3:7] = False
    np.testing.assert_array_equal(marked, expected)
    assert (blank == 255).all()


@pytest.mark.parametrize("name", ["a.gif", "a.mp4", "a.png"])
def test_a_film_replaces_its_like_and_nothing_else(tmp_path, pictures, name):
    path = tmp_path / name
    path.write_bytes(b"a holiday")
    with pytest.raises(ValueError, match=r"no other file at .*got one that was not made here"):
        write_film(path, pictures)
    assert path.read_bytes() == b"a holiday"
    path.unlink()
    for _ in range(2):
        write_film(path, pictures)
    assert path.stat().st_size > 100
