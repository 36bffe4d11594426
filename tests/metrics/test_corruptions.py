"""Damaged streams: what each damage keeps and what it destroys."""

import numpy as np
import pytest

from eqs.events import Events
from eqs.metrics import corruptions as damage


def same(a, b):
    return len(a) == len(b) and all(
        np.array_equal(getattr(a, name), getattr(b, name)) for name in "txyp"
    )


@pytest.fixture
def events(make_events):
    return make_events(1, count=20_000)


def test_thinning_keeps_a_random_subset(events):
    kept = damage.thinned(events, 0.3)
    deviation = np.sqrt(20_000 * 0.3 * 0.7)
    assert abs(len(kept) - 14_000) < 5 * deviation
    rows = {tuple(row) for row in np.stack([events.t, events.x, events.y, events.p], 1).tolist()}
    assert all(tuple(row) in rows for row in np.stack([kept.t, kept.x, kept.y, kept.p], 1).tolist())
    assert same(damage.thinned(events, 0.0), events)
    assert len(damage.thinned(events, 1.0)) == 0


def test_draws_are_keyed(events):
    for draw in (
        lambda **key: damage.thinned(events, 0.5, **key),
        lambda **key: damage.shuffled_in_windows(events, **key),
        lambda **key: damage.poisson(events, **key),
    ):
        assert same(draw(seed=1, key="a"), draw(seed=1, key="a"))
        assert not same(draw(seed=1, key="a"), draw(seed=2, key="a"))
        assert not same(draw(seed=1, key="a"), draw(seed=1, key="b"))


def test_flip_undoes_itself(events):
    flipped = damage.polarity_flipped(events)
    assert np.array_equal(flipped.p + events.p, np.ones(len(events)))
    assert same(damage.polarity_flipped(flipped), events)


def test_shift_moves_and_loses_the_border(events):
    moved = damage.shifted_in_space(events, columns=3, rows=-2)
    inside = (events.x < 25) & (events.y >= 2)
    assert np.array_equal(moved.x, events.x[inside] + 3)
    assert np.array_equal(moved.y, events.y[inside] - 2)
    assert np.array_equal(moved.t, events.t[inside])


def test_frame_lock_moves_to_the_nearest_frame():
    events = Events.from_arrays(
        t=[0, 14, 15, 16, 99], x=[0] * 5, y=[0] * 5, p=[0] * 5, height=1, width=1
    )
    assert damage.frame_locked(events, [10, 20, 30]).t.tolist() == [10, 10, 20, 20, 30]
    assert damage.frame_locked(events, [50]).t.tolist() == [50] * 5
    with pytest.raises(ValueError, match="at least one frame time"):
        damage.frame_locked(events, [])


def test_shuffle_keeps_each_window_as_a_set(events):
    shuffled = damage.shuffled_in_windows(events, 50_000, start_us=10_000)
    assert np.array_equal(shuffled.t, events.t)
    for start in range(-40_000, 1_000_000, 50_000):
        a, b = (each.window(start, start + 50_000) for each in (events, shuffled))
        cells = [np.sort((each.y.astype(int) * 28 + each.x) * 2 + each.p) for each in (a, b)]
        assert np.array_equal(*cells)
    assert np.mean(shuffled.x == events.x) < 0.1


def test_poisson_has_the_rate_and_no_structure(events):
    noise = damage.poisson(events, start_us=0, stop_us=1_000_000)
    assert abs(len(noise) - 20_000) < 5 * np.sqrt(20_000)
    assert noise.t[0] >= 0
    assert noise.t[-1] < 1_000_000
    counts = np.bincount(noise.y.astype(int) * 28 + noise.x, minlength=560)
    assert counts.var() / counts.mean() == pytest.approx(1, abs=0.35)
    brighter = Events(
        events.t, events.x, events.y, np.ones_like(events.p), events.height, events.width
    )
    assert damage.poisson(brighter).p.min() == 1


def test_noise_adds_to_the_stream(events):
    noisy = damage.with_noise(events, 0.5)
    assert abs(len(noisy) - 30_000) < 5 * np.sqrt(10_000)
    assert same(damage.with_noise(events, 0.0), events)


def test_other_recording_plays_on_this_clock(make_events):
    other = make_events(2, start_us=5_000, stop_us=105_000)
    played = damage.on_clock_of(other, 1_000_000, 1_250_000)
    length = int(other.t[-1] - other.t[0]) + 1
    assert np.array_equal(played.t[: len(other)], other.t - other.t[0] + 1_000_000)
    assert np.array_equal(played.window(1_000_000 + length, 1_250_000).t[:9], played.t[:9] + length)
    assert 1_200_000 < played.t[-1] < 1_250_000
    with pytest.raises(ValueError, match="got an empty one"):
        damage.on_clock_of(Events.empty(2, 2), 0, 1)


def test_jitter_in_time_moves_by_its_sigma_and_keeps_order(events):
    moved = damage.jittered_in_time(events, 1_000)
    assert len(moved) == len(events)
    assert (np.diff(moved.t) >= 0).all()
    still = damage.jittered_in_time(events, 0.0)
    assert same(still, events)
    # Followed by their pixels, which are few, events lie about a sigma from where they were.
    order = np.argsort(events.t, kind="stable")
    assert 0.5 < np.abs(np.sort(moved.t) - events.t[order]).mean() < 1_000


def test_jitter_in_space_keeps_times_and_loses_the_border(events):
    moved = damage.jittered_in_space(events, 2.0)
    assert len(events) > len(moved) > 0.6 * len(events)
    assert set(moved.t) <= set(events.t)
    assert same(damage.jittered_in_space(events, 0.0), events)


def test_reversal_undoes_itself(events):
    backwards = damage.reversed_in_time(events)
    assert (np.diff(backwards.t) >= 0).all()
    assert (backwards.t[0], backwards.t[-1]) == (events.t[0], events.t[-1])
    assert backwards.p[0] == 1 - events.p[-1]
    again = damage.reversed_in_time(backwards)
    assert np.array_equal(again.t, events.t)
    assert np.array_equal(again.p, events.p)


def test_hot_pixels_fire_at_their_rate(events):
    noisy = damage.with_hot_pixels(events, share=0.01, rate_hz=500.0)
    counts = np.bincount(noisy.y.astype(int) * 28 + noisy.x, minlength=560)
    before = np.bincount(events.y.astype(int) * 28 + events.x, minlength=560)
    seconds = (events.t[-1] - events.t[0]) / 1e6
    hot = counts - before
    assert (hot > 0).sum() == 6  # one percent of 560
    assert hot[hot > 0] == pytest.approx(500 * seconds, abs=1)
    assert (np.diff(noisy.t) >= 0).all()


def test_doubled_threshold_keeps_every_second_level():
    # Three up, one down, two up: levels 1 2 3 2 3 4 of C; those of 2 C are at 2 and 4.
    signs = [1, 1, 1, 0, 1, 1]
    events = Events.from_arrays(t=range(6), x=[0] * 6, y=[0] * 6, p=signs, height=1, width=2)
    assert damage.at_double_threshold(events).t.tolist() == [1, 5]
    ripple = Events.from_arrays(t=range(6), x=[1] * 6, y=[0] * 6, p=[1, 0] * 3, height=1, width=2)
    assert len(damage.at_double_threshold(ripple)) == 0


def test_silence_can_be_damaged(make_events):
    silence = Events.empty(20, 28)
    for damaged in (
        damage.thinned(silence, 0.5),
        damage.polarity_flipped(silence),
        damage.shifted_in_space(silence, 1),
        damage.frame_locked(silence, [1]),
        damage.shuffled_in_windows(silence),
        damage.poisson(silence),
        damage.with_noise(silence),
        damage.jittered_in_time(silence, 10),
        damage.jittered_in_space(silence, 1),
        damage.reversed_in_time(silence),
        damage.with_hot_pixels(silence),
        damage.at_double_threshold(silence),
    ):
        assert len(damaged) == 0


def test_probability_out_of_range_is_refused(events):
    with pytest.raises(ValueError, match=r"drop between 0 and 1, got 1\.5"):
        damage.thinned(events, 1.5)
