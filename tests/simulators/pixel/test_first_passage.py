"""Rates of noise events against the exact two-sided passage time and against simulated noise."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from eqs.simulators.pixel.first_passage import passage_rate


def two_sided(low, high):
    """Mean time in which noise of unit spread and correlation time leaves (-low, high) from 0."""

    def rise(first, last):
        return quad(lambda z: math.exp(z * z / 2), first, last)[0]

    up = rise(-low, 0) / rise(-low, high)
    below = quad(lambda z: rise(-low, z) * math.exp(-z * z / 2), -low, 0)[0]
    above = quad(lambda z: rise(z, high) * math.exp(-z * z / 2), 0, high)[0]
    return (1 - up) * below + up * above


@pytest.mark.parametrize(
    ("low", "high", "tolerance"), [(2.79, 2.79, 0.04), (3, 4, 0.03), (4, 4, 0.005), (5, 5, 1e-3)]
)
def test_two_barriers_add_their_rates(low, high, tolerance):
    rate = passage_rate(low) + passage_rate(high)
    assert rate * two_sided(low, high) == pytest.approx(1, abs=tolerance)


def test_near_barriers_are_passed_a_sixth_too_seldom():
    """What adding two one-sided rates costs where noise is half a threshold."""
    assert 2 * passage_rate(2.0) * two_sided(2, 2) == pytest.approx(0.86, abs=0.01)


def test_simulated_noise_passes_as_often():
    """Noise looked at every 1/400 of its correlation time misses a little: 0.583 of a step."""
    generator = np.random.default_rng(0)
    step, barrier = 1 / 400, 2.5
    spread = math.sqrt(1 - math.exp(-2 * step))
    values, passages = np.zeros(4000), 0
    for _ in range(40_000):
        values = values * math.exp(-step) + spread * generator.standard_normal(4000)
        passed = values >= barrier
        passages += passed.sum()
        values[passed] = 0.0
    rate = passages / (4000 * 40_000 * step)
    assert rate == pytest.approx(passage_rate(barrier + 0.583 * spread), rel=0.03)
