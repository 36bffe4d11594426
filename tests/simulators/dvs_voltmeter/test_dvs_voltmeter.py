"""DVS-Voltmeter against closed forms, a scalar model, and the laws of first passages."""

import math

import numpy as np
import pytest
from simulator_checks import assert_agree, still

from eqs.simulators import DVSVoltmeter
from eqs.simulators.dvs_voltmeter.passage import chance_of_on, passage_time
from eqs.simulators.pixel.randomness import draw_key, word_at

QUIET = {"photon_noise_per_sqrt_us": 0.0, "thermal_noise_per_sqrt_us": 0.0}
IDEAL = QUIET | {"leak_per_us": 0.0, "light_leak_per_us": 0.0}


def scalar_voltmeter(frames, times, gain, dark):
    """The same drift without noise: a line from barrier to barrier."""
    events = []
    for y, x in np.ndindex(frames.shape[1:]):
        voltage = 0.0
        for k in range(1, len(frames)):
            first, last, span = float(frames[k - 1, y, x]), float(frames[k, y, x]), times[k]
            span -= times[k - 1]
            change = gain * (last - first) / ((first + last) / 2 + dark)
            sign = 1 if change > 0 else -1
            crossed = 0
            while sign * (voltage + change) - crossed > 1:
                crossed += 1
                share = (sign * crossed - voltage) / change
                events.append((int(times[k - 1] + share * span), y, x, int(sign > 0)))
            voltage += change - sign * crossed
    return sorted(events)


def test_without_noise_random_walks_agree_with_a_scalar_model(walk):
    frames, times = walk
    events = DVSVoltmeter(**IDEAL).simulate(frames, times)
    assert_agree(events, scalar_voltmeter(frames, times.tolist(), 5.265, 20.0), 1000)


def test_the_published_noise_hardly_moves_the_events_of_a_ramp():
    frames = np.broadcast_to(np.array([128.0, 138.0])[:, None, None], (2, 20, 20))
    intervals = []
    for seed in range(3):
        model = DVSVoltmeter(contrast_gain=500.0, seed=seed, mode="faithful")
        events = model.simulate(frames, [0, 4_400])
        pixels = events.y * 20 + events.x
        intervals += [np.diff(events.t[pixels == pixel]) for pixel in range(400)]
    gaps = np.concatenate(intervals)
    drift = 500.0 * 10 / 4400 / (133 + 20)
    assert gaps.mean() == pytest.approx(1 / drift, rel=0.002)


def test_fixed_leaks_have_their_rate_at_once_and_faithful_ones_come_in_step():
    frames, times = still(128, 28, 24), np.arange(28) * 50_000
    rate = 1e-7 + 5e-9 * 128
    fixed = DVSVoltmeter().simulate(frames, times)
    assert len(fixed.window(0, 675_000)) / 576 == pytest.approx(rate * 675_000, abs=0.08)
    assert fixed.p.all()
    faithful = DVSVoltmeter(mode="faithful").simulate(frames, times)
    assert len(faithful.window(0, 1_250_000)) == 0
    late = still(128, 31, 24)
    assert len(DVSVoltmeter(mode="faithful").simulate(late, np.arange(31) * 50_000)) == 576


def test_noise_alone_fires_both_polarities_alike():
    options = IDEAL | {"thermal_noise_per_sqrt_us": 0.01}
    events = DVSVoltmeter(**options).simulate(still(90, 2, 64), [0, 40_000])
    ons = int(events.p.sum())
    assert abs(2 * ons - len(events)) < 4 * math.sqrt(len(events))
    assert len(events) > 4000


DRAWS = 4000


def passages(distance, towards, spread, faithful=False):
    key = draw_key(1, "passages")
    return np.array(
        [
            passage_time(distance, towards, spread, np.uint64(word_at(key, i)), faithful)
            for i in range(DRAWS)
        ]
    )


@pytest.mark.parametrize("towards", [0.5, -0.5])
def test_passage_times_have_the_moments_of_their_law(towards):
    times = passages(0.8, towards, 0.4)
    mean, variance = 0.8 / 0.5, 0.8 * 0.4**2 / 0.5**3
    assert times.mean() == pytest.approx(mean, abs=4 * math.sqrt(variance / DRAWS))
    assert times.var() == pytest.approx(variance, rel=0.15)


def test_passages_without_drift_have_levys_median_and_faithful_ones_twice_that():
    median = (0.8 / 0.4) ** 2 / 0.454936
    assert np.median(passages(0.8, 0.0, 0.4)) == pytest.approx(median, rel=0.12)
    assert np.median(passages(0.8, 0.0, 0.4, True)) == pytest.approx(2 * median, rel=0.12)


@pytest.mark.parametrize("towards", [-0.01, -0.5])
def test_faithful_passages_against_the_drift_are_too_short(towards):
    times = passages(0.8, towards, 0.4, True)
    assert (times > 0).all()
    assert times.max() <= 0.8 / abs(towards)
    assert times.mean() < 0.9 * passages(0.8, towards, 0.4).mean()


@pytest.mark.parametrize("level", [-0.7, 0.0, 0.4])
@pytest.mark.parametrize("drift", [-0.3, -1e-9, 1e-9, 0.3])
def test_sides_have_the_probabilities_of_a_fine_walk(level, drift):
    # A walk of tiny steps: gambler's ruin with the odds that the drift gives to a step.
    steps, spread = 2000, 0.6
    width = 2 / steps
    odds = math.exp(-2 * drift * width / spread**2)
    below = round((1 + level) / width)
    if abs(odds - 1) < 1e-12:
        expected = below / steps
    else:
        expected = math.expm1(below * math.log(odds)) / math.expm1(steps * math.log(odds))
    found = chance_of_on(level, drift, spread, False)
    assert found == pytest.approx(expected, rel=1e-3, abs=1e-6)


@pytest.mark.parametrize("drift", [-1e3, 1e3])
def test_strong_drifts_are_certain(drift):
    assert chance_of_on(-0.5, drift, 1e-3, False) == (1.0 if drift > 0 else 0.0)


def test_nothing_moves_without_drift_and_spread():
    assert passage_time(0.5, 0.0, 0.0, np.uint64(1), False) == math.inf
    assert passage_time(0.5, -1.0, 0.0, np.uint64(1), False) == math.inf
    assert passage_time(0.5, 2.0, 0.0, np.uint64(1), False) == 0.25
