"""The damage that costs as much, and that looks most alike."""

from __future__ import annotations

import numpy as np
import pytest

from eqs.events import Events
from eqs.metrics import corruptions as damage
from eqs.pair import FAMILIES, Profile, damaged, nearest
from eqs.pair.nearest import every, less_contrast, sentence

BY_NAME = {family.name: family for family in FAMILIES}


@pytest.fixture
def events() -> Events:
    rng = np.random.default_rng(0)
    return Events.from_arrays(
        t=np.sort(rng.integers(0, 500_000, 4000)), x=rng.integers(0, 16, 4000),
        y=rng.integers(0, 16, 4000), p=rng.integers(0, 2, 4000), height=16, width=16,
    )  # fmt: skip


def flat(score: float, rate: float = 1.0) -> Profile:
    return Profile((score, score), rate)


def test_a_grade_is_read_off_between_those_that_were_tried() -> None:
    tried = {"dropped": {0.6: flat(0.7, 0.4), 0.3: flat(0.9, 0.7)}, "noise": {0.5: flat(0.6, 1.5)}}
    by_family = {each.family: each for each in nearest(flat(0.8, 0.5), tried)}
    dropped, noise = by_family["dropped"], by_family["noise"]
    assert (dropped.grade, dropped.score) == (pytest.approx(0.45), pytest.approx(0.8))
    assert dropped.words == "45% of the events missing"
    assert (noise.grade, noise.score) == (pytest.approx(0.25), pytest.approx(0.8))
    # Half of the way from the stream itself, which a divisor of one leaves as it is.
    (contrast,) = nearest(flat(0.9), {"contrast": {2.0: flat(0.8, 0.3)}})
    assert contrast.grade == pytest.approx(1.5)


def test_of_damages_that_cost_as_much_the_most_alike_comes_first() -> None:
    tried = {"dropped": {0.5: flat(0.8, 0.5)}, "noise": {0.5: flat(0.8, 1.5)}}
    assert nearest(flat(0.8, 0.4), tried)[0].family == "dropped"
    assert nearest(flat(0.8, 1.7), tried)[0].family == "noise"
    stages = {"jitter": {3.0: Profile((0.7, 0.9), 1.0)}, "shift": {1.0: Profile((0.9, 0.7), 1.0)}}
    assert nearest(Profile((0.75, 0.85), 1.0), stages)[0].family == "jitter"
    assert nearest(Profile((0.85, 0.75), 1.0), stages)[0].family == "shift"
    # However alike it is, a damage that costs something else stands behind.
    far = {"dropped": {0.5: flat(0.9, 0.2)}, "strobe": {50.0: flat(0.65, 1.0)}}
    assert nearest(flat(0.7, 0.2), far)[0].family == "strobe"


def test_below_every_grade_the_last_answers_for_itself_and_the_sentence_says_so() -> None:
    tried = {
        "dropped": {0.3: flat(0.9), 0.9: flat(0.7)},
        "strobe": {50.0: flat(0.65)},
        "jitter": {1.0: flat(0.99), 30.0: flat(0.96)},
    }
    found = nearest(flat(0.2), tried)
    assert [(each.family, round(each.score, 6)) for each in found] == [
        ("strobe", 0.65), ("dropped", 0.7), ("jitter", 0.96),
    ]  # fmt: skip
    said = sentence(found, 0.2, 2.0)
    assert said.startswith("further from real than every damage tried in the first 2 s")
    assert said.endswith("all events on the beat of one frame every 50 ms scores 0.650")
    said = sentence(nearest(flat(0.8), tried), 0.8, 0.45)
    assert said == (
        "as far from real as: 60% of the events missing, of those tried the most alike (in the "
        "first 0.45 s, where it scores 0.800); as much would cost: all events on the beat of one "
        "frame every 29 ms"
    )
    only = nearest(flat(0.8), {"dropped": {0.5: flat(0.8)}, "jitter": {1.0: flat(0.96)}})
    assert sentence(only, 0.8, 2.0).endswith("(in the first 2 s, where it scores 0.800)")


def test_a_stream_equal_to_the_real_one_is_as_far_as_no_damage() -> None:
    (found,) = nearest(flat(1.0), {"dropped": {0.1: flat(0.9, 0.9)}})
    assert (found.grade, found.score, found.apart) == (0.0, 1.0, 0.0)


def test_every_family_makes_what_its_words_say(events: Events) -> None:
    made = {family.name: damaged(events, family) for family in FAMILIES}
    assert all(tuple(made[family.name]) == family.grades for family in FAMILIES)
    assert all(family.grades == tuple(sorted(family.grades)) for family in FAMILIES)
    assert len(made["dropped"][0.9]) == pytest.approx(0.1 * len(events), rel=0.2)
    assert len(made["noise"][2.0]) == pytest.approx(3 * len(events), rel=0.1)
    assert (made["polarity"][0.5].p != events.p).mean() == pytest.approx(0.5, abs=0.05)
    assert np.abs(made["jitter"][3.0].t - events.t).mean() < 3_000
    assert len(np.unique(made["strobe"][50.0].t)) <= 10 + 1
    assert len(made["hot"][5e-4]) > len(events)


def test_a_quarter_of_the_contrast_is_half_of_the_half(events: Events) -> None:
    half = damage.at_double_threshold(events)
    quarter = damage.at_double_threshold(half)
    assert len(less_contrast(events, 2.0)) == len(half)
    assert np.array_equal(less_contrast(events, 4.0).t, quarter.t)
    assert len(less_contrast(Events.empty(4, 4), 8.0)) == len(every(Events.empty(4, 4), 5.0)) == 0
