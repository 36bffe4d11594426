"""Which instant is shown, and what of it."""

import numpy as np
import pytest

from eqs.data import LabelProtocol, RecordedEvents, Recording
from eqs.pipelines.showcase import Showcase, around, choose

PERIOD_US = 100_000
PROTOCOL = LabelProtocol(name="all", classes={"car": [2], "pedestrian": [0]})


@pytest.fixture
def recording(make_recording, tmp_path):
    """Three seconds; at the 20th frame a car and a pedestrian stand apart, else there is a car."""
    start = 1_000_000
    rows = [(start + PERIOD_US * k, 4, 5, 12, 10, 2) for k in range(30)]
    rows += [(start + PERIOD_US * 3, 20, 5, 8, 8, 0), (start + PERIOD_US * 20, 20, 5, 8, 8, 0)]
    folder = make_recording(tmp_path / "one", frames=30, period_us=PERIOD_US, tracks=sorted(rows))
    return Recording.load(folder, height=24, width=32)


def test_the_instant_with_most_classes_after_the_first_second_is_chosen(recording):
    shown = choose([recording], PROTOCOL)
    assert shown.index == 20  # not 3, which lies in the first second
    assert sorted(shown.truth(PROTOCOL).labels.tolist()) == [0, 1]
    assert shown.stop_us == recording.frame_times_us[20]
    np.testing.assert_array_equal(shown.frame, recording.read_frame(20))


def test_without_labels_the_middle_of_the_first_recording_is_chosen(make_recording, tmp_path):
    folder = make_recording(tmp_path / "bare", frames=9, tracks=None)
    assert choose([Recording.load(folder, height=24, width=32)], PROTOCOL).index == 4


def test_events_end_at_the_instant_and_reach_as_far_back_as_asked(recording):
    shown = Showcase(recording=recording, index=20)
    events = shown.events(RecordedEvents(), before_us=30_000)
    assert len(events)
    assert shown.stop_us - 30_000 <= events.t[0]
    assert events.t[-1] < shown.stop_us
    longer = around(shown, {"real": RecordedEvents()})["real"]
    assert longer.t[0] < shown.stop_us - 1_400_000
    np.testing.assert_array_equal(longer.window(shown.stop_us - 30_000, shown.stop_us).t, events.t)
