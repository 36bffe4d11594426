"""The streams whose answer is known: anchors and the sanity battery."""

import numpy as np
import pytest

from eqs.events import Events
from eqs.metrics import EXPECTED_ORDER, GRADED, anchors, singles


@pytest.fixture
def events(make_events):
    return make_events(1, count=20_000)


def test_table_of_anchors(events, make_events):
    table = anchors(events, other=make_events(5), frame_times_us=[0, 50_000], key="a")
    assert {"identical", "ceiling", "chance", "blank", "poisson", "frame_locked"} <= table.keys()
    assert "chance" not in anchors(events)
    assert len(table["blank"]) == 0
    assert len(table["thinned_50"]) < len(table["ceiling"]) < len(table["identical"])
    with pytest.raises(ValueError, match="real stream with events"):
        anchors(Events.empty(2, 2))


def test_battery_holds_the_anchors_and_the_expected_order(events, make_events):
    given = {"other": make_events(5), "frame_times_us": [0, 50_000], "key": "a"}
    everything = singles(events, **given)
    assert anchors(events, **given).keys() <= everything.keys()
    assert set(EXPECTED_ORDER) <= everything.keys()
    assert len(everything["double_threshold"]) < 0.6 * len(events)


def test_battery_shuffles_within_the_windows_of_the_score(events):
    shuffled = singles(events, start_us=30_000, stop_us=1_000_000, key="a")["shuffled"]
    window = (events.t - 30_000) // 50_000
    for index in np.unique(window):
        here = window == index
        pixels = sorted(zip(events.x[here], events.y[here], events.p[here], strict=True))
        found = sorted(zip(shuffled.x[here], shuffled.y[here], shuffled.p[here], strict=True))
        assert found == pixels


def test_every_graded_corruption_has_five_levels_of_growing_damage(events):
    families = {}
    for grade in GRADED:
        families.setdefault(grade.family, []).append(grade)
    for grades in families.values():
        severities = [grade.severity for grade in grades]
        assert len(grades) == 5
        assert severities == sorted(severities)
        first, last = (grade.apply(events, key="a") for grade in (grades[0], grades[-1]))
        changed = [
            len(each) != len(events)
            or not np.array_equal(each.t, events.t)
            or not np.array_equal(each.x, events.x)
            for each in (first, last)
        ]
        assert all(changed)
