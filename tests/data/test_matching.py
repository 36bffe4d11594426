"""Labels and frames whose times differ by a rounding, and those that do not belong together."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eqs.data import LabelProtocol, seen_between_frames
from eqs.data.matching import match_labels

FRAMES = 1_000_000 + 50_000 * np.arange(30)


def tracks_at(times):
    tracks = np.zeros(len(times), [("t", np.int64), ("x", float)])
    tracks["t"], tracks["x"] = times, np.arange(len(times))
    return tracks


@pytest.mark.parametrize("offset_us", [0, 1, -1, 499, 5_000, -5_000])
def test_labels_a_rounding_off_belong_to_their_frame(offset_us):
    found = match_labels(tracks_at(FRAMES + offset_us), FRAMES, tolerance_us=5_000)
    assert found.matched == found.label_times == 30
    assert found.farthest_us == abs(offset_us)
    assert [found.at(frame)["x"].tolist() for frame in range(30)] == [[k] for k in range(30)]
    assert not found.doubtful


@pytest.mark.parametrize("offset_us", [5_001, -20_000])
def test_labels_of_another_time_belong_to_none(offset_us):
    found = match_labels(tracks_at(FRAMES + offset_us), FRAMES, tolerance_us=5_000)
    assert found.matched == 0
    assert found.share == 0
    assert found.doubtful == frozenset(range(30))


def test_of_two_looks_at_one_frame_the_nearer_counts():
    found = match_labels(tracks_at([1_049_998, 1_050_001, 1_050_001]), FRAMES, tolerance_us=5_000)
    assert found.at(1)["x"].tolist() == [1, 2]
    assert (found.matched, found.label_times) == (1, 2)
    assert not found.doubtful  # the frame is labelled


def test_every_label_is_matched_whatever_the_tolerance_when_there_are_none():
    found = match_labels(tracks_at([]), FRAMES, tolerance_us=0)
    assert found.share == 1
    assert len(found.at(3)) == 0


@given(st.lists(st.integers(900_000, 2_600_000), max_size=30), st.integers(0, 60_000))
def test_a_label_goes_to_the_nearest_frame_within_the_tolerance_and_to_one(times, tolerance_us):
    found = match_labels(tracks_at(times), FRAMES, tolerance_us)
    nearest = {t: int(np.abs(FRAMES - t).argmin()) for t in times}
    for frame in range(len(FRAMES)):
        rows = found.at(frame)
        assert len({*rows["t"].tolist()}) <= 1
        mine = [t for t in times if nearest[t] == frame and abs(FRAMES[frame] - t) <= tolerance_us]
        assert bool(len(rows)) == bool(mine)
        if mine:
            best = min(abs(FRAMES[frame] - t) for t in mine)
            assert abs(FRAMES[frame] - rows["t"][0]) == best
            assert len(rows) == times.count(int(rows["t"][0]))


def test_nothing_labelled_is_nothing_matched():
    found = LabelProtocol(name="p", classes={"car": [2]}).match(None, FRAMES)
    assert found.label_times == 0


@pytest.mark.parametrize(
    ("period_us", "ratio", "said"),
    [(50_000, 1.0, ""), (50_400, 1.008, ""), (200_000, 4.0, "75 %"), (10_000, 0.2, "5.0 times")],
)
def test_frames_and_windows_that_differ_are_named(period_us, ratio, said):
    found, words = seen_between_frames(period_us * np.arange(9))
    assert found == pytest.approx(ratio)
    assert said in words
    assert bool(said) == bool(words)
