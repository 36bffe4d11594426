"""Shot noise: who fires it, and when."""

import numpy as np
import pytest

from eqs.simulators.pixel.noise import noisy_pixels, scatter_noise, shot_events
from eqs.simulators.pixel.randomness import draw_key, poisson, word_at
from eqs.simulators.streaming.keys import TIME_SHIFT

PIXELS, SPAN_US, NOMINAL = 5_000, 50_000, (0.2, 0.3)
LEVELS = np.arange(256.0)


@pytest.fixture
def pixels():
    """Grey levels and thresholds that differ widely."""
    generator = np.random.default_rng(0)
    codes = generator.integers(0, 256, PIXELS).astype(np.uint8)
    on, off = (np.maximum(generator.normal(mean, 0.1, PIXELS), 0.01) for mean in NOMINAL)
    return codes, on, off


def noisy(pixels, shot_noise_hz):
    """Expected events of one polarity per code, and the noisy pixels with their numbers."""
    codes, on, off = pixels
    shot = shot_events(LEVELS, shot_noise_hz, SPAN_US)
    chosen, numbers = np.empty(PIXELS, np.int32), np.empty(PIXELS, np.int64)
    least, key = (on.min(), off.min()), draw_key(0, "noise")
    count, total = noisy_pixels(codes, shot, on, off, NOMINAL, least, key, chosen, numbers)
    assert total == numbers[:count].sum()
    return shot, chosen[:count], numbers[:count]


@pytest.mark.parametrize("shot_noise_hz", [1e-3, 0.1, 10.0])
def test_the_noisy_pixels_are_those_whose_own_poisson_number_is_not_nought(pixels, shot_noise_hz):
    codes, on, off = pixels
    shot, chosen, numbers = noisy(pixels, shot_noise_hz)
    expected = shot[codes] * (NOMINAL[0] / on + NOMINAL[1] / off)
    key = draw_key(0, "noise")
    words = [np.uint64(word_at(key, pixel)) for pixel in range(PIXELS)]
    plain = np.array([poisson(*each) for each in zip(words, expected, strict=True)])
    assert np.array_equal(chosen, np.flatnonzero(plain))
    assert np.array_equal(numbers, plain[chosen])


def test_noise_has_its_rate_and_polarity_and_makes_pixels_forget(pixels):
    codes, on, off = pixels
    shot, chosen, numbers = noisy(pixels, 10.0)
    above, keys = np.ones(PIXELS), np.empty(numbers.sum(), np.int64)
    key = draw_key(0, "noise")
    scatter_noise(chosen, numbers, codes, shot, above, on, off, NOMINAL, key, 1_000, SPAN_US, keys)
    expected_on = (shot[codes] * NOMINAL[0] / on).sum()
    expected_off = (shot[codes] * NOMINAL[1] / off).sum()
    for found, expected in ((keys & 1).sum(), expected_on), ((1 - (keys & 1)).sum(), expected_off):
        assert abs(found - expected) < 4 * np.sqrt(expected)
    times_us = keys >> TIME_SHIFT
    assert times_us.min() >= 1_000
    assert times_us.max() < 1_000 + SPAN_US
    assert np.array_equal(np.flatnonzero(above == 0), chosen)
