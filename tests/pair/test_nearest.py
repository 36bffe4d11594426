"""The damage that costs as much."""

from __future__ import annotations

import numpy as np
import pytest

from eqs.events import Events
from eqs.pair import DAMAGES, damaged, nearest
from eqs.pair.nearest import sentence


def test_a_grade_is_read_off_between_those_that_were_tried() -> None:
    scores = {("dropped", 0.3): 0.9, ("dropped", 0.6): 0.7, ("noise", 0.5): 0.6}
    (first, second) = nearest(0.8, scores)
    assert (first.family, first.grade, first.score) == ("dropped", pytest.approx(0.45), 0.8)
    assert second.family == "noise"
    assert nearest(0.95, scores)[0].grade == pytest.approx(0.15)  # half way to the first


def test_below_every_grade_the_last_answers_for_itself() -> None:
    scores = {("dropped", 0.3): 0.9, ("dropped", 0.9): 0.7, ("strobe", 20.0): 0.65}
    found = nearest(0.2, scores)
    assert [(each.family, each.score) for each in found] == [("strobe", 0.65), ("dropped", 0.7)]
    assert sentence(found, 0.2).startswith("like no damage that was tried: the nearest, all events")
    assert sentence(nearest(0.8, scores), 0.8) == "as far from real as: 60% of the events missing"


def test_every_family_has_its_damages() -> None:
    rng = np.random.default_rng(0)
    events = Events.from_arrays(
        t=np.sort(rng.integers(0, 500_000, 4000)), x=rng.integers(0, 16, 4000),
        y=rng.integers(0, 16, 4000), p=rng.integers(0, 2, 4000), height=16, width=16,
    )  # fmt: skip
    made = damaged(events, start_us=0, stop_us=500_000)
    assert {family for family, _ in made} == {*DAMAGES}
    assert len(made["dropped", 0.9]) < len(made["dropped", 0.1]) < len(events)
    assert len(made["noise", 2.0]) == pytest.approx(3 * len(events), rel=0.1)
    assert set(made["strobe", 20.0].t % 50_000) == {0}
    assert (made["polarity", 1.0].p != events.p).all()
