"""The counter-based generator: known words, distributions, independence."""

import math

import numpy as np
import pytest
from numba import njit
from scipy import stats

from eqs.simulators.pixel.randomness import (
    NORMAL_QUANTILES,
    ZIGGURAT,
    draw_key,
    normal_map,
    normal_quantile,
    poisson,
    uniform_map,
    word_at,
    ziggurat_normal,
)

COUNT = 40_000


@njit
def poisson_draws(key, expected, count):
    draws = np.empty(count, np.int64)
    for index in range(count):
        draws[index] = poisson(word_at(key, index), expected)
    return draws


@njit
def quantile_draws(key, count, quantiles):
    draws = np.empty(count)
    for index in range(count):
        draws[index] = normal_quantile(word_at(key, index), quantiles)
    return draws


@njit
def ziggurat_draws(key, count):
    draws = np.empty(count)
    for index in range(count):
        draws[index] = ziggurat_normal(word_at(key, index))
    return draws


def test_words_are_those_of_splitmix64():
    # First outputs of the reference generator from the seed 1234567.
    words = [int(word_at(np.uint64(1234567), index)) for index in range(3)]
    assert words == [6457827717110365317, 3203168211198807973, 9817491932198370423]


def test_uniform_numbers_are_uniform():
    values = uniform_map(draw_key(0, "a"), COUNT)
    assert stats.kstest(values, "uniform").pvalue > 1e-3
    assert values.min() >= 0
    assert values.max() < 1


def test_normal_numbers_are_normal():
    assert stats.kstest(normal_map(draw_key(0, "a"), COUNT), "norm").pvalue > 1e-3


def test_ziggurat_numbers_are_normal_far_into_the_tails():
    values = ziggurat_draws(draw_key(0, "a"), 2_000_000)
    assert stats.kstest(values, "norm").pvalue > 1e-3
    last_layer = ZIGGURAT[1]
    for bound in (1.0, 2.0, last_layer, 4.0):
        for tail in (values > bound, values < -bound):
            expected = len(values) * stats.norm.sf(bound)
            assert abs(tail.sum() - expected) < 4 * math.sqrt(expected)
    sizes = np.abs(values[np.abs(values) > last_layer])
    law = stats.truncnorm(last_layer, np.inf)
    assert stats.kstest(sizes, law.cdf).pvalue > 1e-3


@pytest.mark.parametrize(
    ("first", "second"),
    [(draw_key(0, "a"), draw_key(0, "b")), (draw_key(0, "a"), draw_key(1, "a"))],
)
def test_families_are_independent(first, second):
    correlation = np.corrcoef(normal_map(first, COUNT), normal_map(second, COUNT))[0, 1]
    assert abs(correlation) < 4 / math.sqrt(COUNT)


def test_neighbours_are_independent():
    values = normal_map(draw_key(0, "a"), COUNT)
    for lag in (1, 2, 640):
        correlation = np.corrcoef(values[:-lag], values[lag:])[0, 1]
        assert abs(correlation) < 4 / math.sqrt(COUNT - lag)


@pytest.mark.parametrize("expected", [0.01, 0.5, 6.0])
def test_poisson_counts_have_the_right_distribution(expected):
    draws = poisson_draws(draw_key(0, "p"), expected, COUNT)
    law = stats.poisson(expected)
    top = int(law.ppf(0.999))
    observed = np.bincount(np.minimum(draws, top + 1), minlength=top + 2)
    shares = np.append(law.pmf(np.arange(top + 1)), law.sf(top))
    assert stats.chisquare(observed, shares * COUNT / shares.sum()).pvalue > 1e-3


def test_quick_normal_numbers_have_normal_moments():
    draws = quantile_draws(draw_key(0, "q"), COUNT, NORMAL_QUANTILES)
    assert draws.mean() == pytest.approx(0, abs=4 / math.sqrt(COUNT))
    assert draws.std() == pytest.approx(1, abs=0.02)
    assert stats.kurtosis(draws) == pytest.approx(0, abs=0.1)
    assert NORMAL_QUANTILES.std() == pytest.approx(1, abs=1e-12)
