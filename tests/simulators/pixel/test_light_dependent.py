"""The light-dependent photoreceptor against the closed forms of its two laws."""

import math

import numpy as np
import pytest
from scipy.special import expi

from eqs.simulators.pixel.filtered.circuit import SEEING, Circuit, Pixel, Ramp, settled

SPAN_US = 50_000.0


def followed(level, light, slope, rate, span_us, large):
    """The response at the end of a span in which the log light is a line."""
    pixel = Pixel(level, level, 0.0, SEEING, SEEING)
    ramp = Ramp(light, slope, math.exp(-light) / rate, 0.0)
    circuit = Circuit(rate=rate, large=large, pole_us=0.0, refractory_us=0.0, resets=False)
    return settled(pixel, ramp, span_us, circuit).received


def exact(level, light, change, rate, span_us, large):
    """Both laws solved with the exponential integral, for a log light that is a line."""
    slope = change / span_us
    start = rate / slope * math.exp(light)
    end = start * math.exp(change)
    decay = math.exp(-(end - start))
    # exp(-end) (Ei(end) - Ei(start)), with both terms scaled before they overflow
    rise = math.exp(-end) * (expi(end) - expi(start))
    if large:
        return -math.log(decay * math.exp(-level) + rate / slope * rise)
    return light + change + decay * (level - light) - rise


def draws(count, largest=3.0):
    generator = np.random.default_rng(0)
    while count:
        rate = math.exp(generator.uniform(math.log(10), math.log(2000))) * 1e-6
        change, light = generator.uniform(-largest, largest), generator.uniform(-2, 1)
        level = light + generator.uniform(-1, 1)
        start = rate / (change / SPAN_US) * math.exp(light)
        if max(abs(start), abs(start * math.exp(change))) < 600:  # where the integrals are finite
            count -= 1
            yield level, light, change, rate


@pytest.mark.parametrize(
    ("large", "usual", "most"), [(False, 0.0022, 0.003), (True, 0.0038, 0.0045)]
)
def test_both_laws_are_followed_to_a_fiftieth_of_a_threshold(large, usual, most):
    errors = [
        abs(
            followed(level, light, change / SPAN_US, rate, SPAN_US, large)
            - exact(level, light, change, rate, SPAN_US, large)
        )
        for level, light, change, rate in draws(400)
    ]
    assert np.quantile(errors, 0.95) < usual
    assert max(errors) < most


def test_brightening_is_quick_and_darkening_slow_by_the_large_signal_law():
    """Times of half the way after a step, in closed form; 100 per second in the light before."""
    for contrast, up_ms, down_ms in ((0.25, 5.90, 8.12), (1.0, 3.58, 12.89), (2.0, 1.78, 23.15)):
        for light, half_ms in ((contrast, up_ms), (-contrast, down_ms)):
            level = followed(0.0, light, 0.0, 1e-4, 1000 * half_ms, True)
            assert level == pytest.approx(light / 2, rel=0.002)


def test_a_settled_filter_lags_a_line_by_its_slope_times_its_time_constant():
    slope, rate = 1e-9, 1e-3
    level = followed(0.0, 0.0, slope, rate, 1e6, False)
    assert level == pytest.approx(slope * 1e6 - slope / (rate * math.exp(1e-3)), abs=2e-9)
