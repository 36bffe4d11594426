"""Integrate and fire: exact where closed forms are known, unbiased, regular, and in no hurry."""

import numpy as np
import pytest

from eqs.simulators.learned.firing import integrate_and_fire
from eqs.simulators.streaming.keys import TIME_SHIFT

SPAN = 50_000


def fired(counts, phases, span=SPAN):
    """Times and polarities of the events of one pixel or many."""
    keys, count = integrate_and_fire(counts, phases, 0, span, np.empty(1, np.int64))
    return keys[:count] >> TIME_SHIFT, keys[:count] & 1


def test_a_steady_expectation_gives_evenly_spaced_events():
    counts = np.zeros((2, 10, 1))
    counts[1] = 0.375
    times, polarity = fired(counts, np.full((2, 1), 0.25))
    np.testing.assert_array_equal(times, [10_000, 23_333, 36_666, 50_000])
    assert polarity.all()


def test_many_events_fit_in_one_bin():
    counts = np.zeros((2, 10, 1))
    counts[0, 3] = 5.0
    times, polarity = fired(counts, np.zeros((2, 1)))
    np.testing.assert_array_equal(times, 15_000 + np.arange(1, 6) * 1000)
    assert not polarity.any()


def test_the_number_is_what_is_expected_and_varies_less_than_a_poisson_number():
    random = np.random.default_rng(0)
    counts = random.exponential(0.05, (2, 10, 20_000))
    phases = random.random((2, 20_000))
    before = phases.copy()
    times, _ = fired(counts, phases)
    expected = counts.sum(axis=1)
    assert len(times) == pytest.approx(expected.sum(), rel=0.01)
    numbers = expected + before - phases
    np.testing.assert_allclose(numbers, np.round(numbers), atol=1e-9)
    left = (np.round(numbers) - expected).var()
    # A fraction f of an event falls or does not, with variance f (1 - f).
    fraction = expected % 1
    assert left == pytest.approx((fraction * (1 - fraction)).mean(), rel=0.03)
    assert left < 0.5 * expected.mean()


def test_intervals_in_pieces_give_the_same_events_and_phases():
    counts = np.random.default_rng(1).exponential(0.3, (2, 10, 50))
    whole, parts = np.full((2, 50), 0.25), np.full((2, 50), 0.25)
    times, _ = fired(counts, whole)
    pieces = [fired(counts[:, k : k + 5], parts, SPAN // 2)[0] + k * SPAN // 10 for k in (0, 5)]
    assert len(times) == sum(map(len, pieces))
    assert np.abs(np.sort(times) - np.sort(np.concatenate(pieces))).max() <= 1
    np.testing.assert_allclose(whole, parts, atol=1e-9)


def test_nothing_expected_is_nothing_fired():
    phases = np.full((2, 4), 0.999)
    times, _ = fired(np.zeros((2, 10, 4)), phases)
    assert len(times) == 0
    assert (phases == 0.999).all()
