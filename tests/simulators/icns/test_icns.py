"""ICNS against a finely integrated pixel, nominal rates, and its published defects."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq
from simulator_checks import assert_poisson, still

from eqs.frames import GreyImage
from eqs.simulators import ICNS
from eqs.simulators.pixel.ramp_response import first_crossing, response

CLEAN = {
    "threshold_sigma_log": 0.0,
    "jitter_us": 0.0,
    "background_on_hz": 0.0,
    "background_off_hz": 0.0,
}


def integrated_icns(frames, times, model, step_us=0.5):
    """One pixel by small steps of its differential equation, without any closed form."""
    log = np.log1p(frames.astype(float) * model.white_lux / 255)
    voltage = reset = log[0]
    blind = -math.inf
    events = []
    for k in range(1, len(log)):
        tau = model.time_constant_us * 1000 / math.exp(0.5 * (log[k - 1] + log[k]))
        for now in np.arange(times[k - 1], times[k], step_us):
            share = (now + 0.5 * step_us - times[k - 1]) / (times[k] - times[k - 1])
            light = log[k - 1] + share * (log[k] - log[k - 1])
            voltage += (light - voltage) * (1 - math.exp(-step_us / tau))
            if now + step_us < blind:
                continue
            if blind > -math.inf:
                reset, blind = voltage, -math.inf
            change = voltage - reset
            if change >= model.threshold_on_log or change <= -model.threshold_off_log:
                events.append((now + step_us + model.latency_us, int(change > 0)))
                blind = now + step_us + model.latency_us + model.refractory_us
    return events


def test_events_agree_with_a_finely_integrated_pixel():
    model = ICNS(**CLEAN, threshold_on_log=0.2, threshold_off_log=0.15, time_constant_us=150.0)
    frames = np.random.default_rng(2).integers(0, 120, (9, 1, 3), np.uint8)
    times = np.arange(9) * 2000
    events = model.simulate(frames, times)
    found = 0
    for x in range(3):
        expected = integrated_icns(frames[:, 0, x], times, model)
        chosen = events.x == x
        assert events.p[chosen].tolist() == [polarity for _, polarity in expected]
        error = np.abs(events.t[chosen] - np.array([time for time, _ in expected]))
        assert np.median(error) <= 2
        assert error.max() <= 12  # small steps err most where the voltage is slow
        found += len(expected)
    assert found > 40


def test_a_response_that_turns_round_is_found_on_both_sides():
    # From 1 down towards a ramp that starts at 0 and climbs: down to a turn, then up.
    arguments = (1.0, 0.0, 0.01, 50.0)
    path = np.array([response(*arguments, wait) for wait in range(400)])
    lowest = path.argmin()
    assert 0 < lowest < 399
    down, up = first_crossing(*arguments, 400.0, (0.9, 9.0))
    assert not up
    assert down == pytest.approx(np.argmax(path <= 0.9), abs=1)
    rise, up = first_crossing(*arguments, 400.0, (path.min() - 0.01, 2.0))
    assert up
    assert rise == pytest.approx(np.argmax(path >= 2.0), abs=1)
    assert first_crossing(*arguments, 400.0, (-9.0, 9.0))[0] == math.inf


def test_crossings_are_the_roots_of_the_response():
    generator = np.random.default_rng(4)
    found = 0
    for _ in range(2000):
        level, light = generator.normal(0, 0.3, 2)
        slope, tau_us = generator.normal(0, 1e-4), 10 ** generator.uniform(0, 5)
        arguments = level, light, slope, tau_us
        bounds = level - generator.uniform(0.01, 0.5), level + generator.uniform(0.01, 0.5)
        path = np.array([response(*arguments, wait) for wait in np.linspace(0, 5e4, 4001)])
        outside = (path <= bounds[0]) | (path >= bounds[1])
        wait_us, up = first_crossing(*arguments, 5e4, bounds)
        if not outside.any():
            assert wait_us == math.inf or response(*arguments, wait_us) == pytest.approx(
                bounds[up], abs=1e-9
            )
            continue
        first = outside.argmax()
        assert up == (path[first] >= bounds[1])
        expected = brentq(
            lambda wait, arguments, bound: response(*arguments, wait) - bound,
            *np.linspace(0, 5e4, 4001)[[first - 1, first]],
            args=(arguments, bounds[up]),
            xtol=1e-9,
        )
        assert wait_us == pytest.approx(expected, abs=1e-5)
        found += 1
    assert found > 500


@pytest.mark.parametrize(("low", "high", "mended"), [(1000, 9000, 5), (10, 1000, 10)])
def test_faithful_pixels_fire_once_a_frame_and_too_early(low, high, mended):
    lux = np.array([low, low, high, high], float)[:, None, None]
    times = np.arange(4) * 50_000
    frames = lux * 255 / 1e4
    faithful = ICNS(**CLEAN, mode="faithful").simulate(frames, times)
    assert len(faithful) == 1
    assert 50_000 <= faithful.t[0] < 50_400
    fixed = ICNS(**CLEAN).simulate(frames, times)
    assert len(fixed) == mended
    assert fixed.t[0] > 50_000 + 40_000 / (mended + 2)


@pytest.mark.parametrize("mode", ["fixed", "faithful"])
def test_the_background_has_its_nominal_rates(mode):
    quiet = CLEAN | {"background_on_hz": 2.0, "background_off_hz": 0.5}
    model = ICNS(**quiet, mode=mode)
    events = model.simulate(still(120, 101, 24), np.arange(101) * 40_000)
    ons = int(events.p.sum())
    for count, rate in ((ons, 2.0), (len(events) - ons, 0.5)):
        assert_poisson(count, rate * 24 * 24 * 4)
    rest = events.t[events.p == 1] % 500_000
    pairs = set(zip(pixels_of(events)[events.p == 1].tolist(), rest.tolist(), strict=True))
    assert (len(pairs) < 1.1 * 576) == (mode == "faithful")


@pytest.mark.parametrize("mode", ["fixed", "faithful"])
def test_a_spread_background_keeps_its_mean_and_differs_between_pixels(mode):
    noisy = CLEAN | {"background_on_hz": 3.0, "background_spread_decades": 0.4}
    model = ICNS(**noisy, mode=mode)
    events = model.simulate(still(120, 501, 40), np.arange(501) * 20_000)
    seconds = 10.0
    rates = model.background_hz(GreyImage.from_frame(still(120, 1, 40)[0]))[0]
    assert rates.mean() == pytest.approx(3.0, rel=0.15)
    assert np.log10(rates).std() == pytest.approx(0.4, rel=0.1)
    counts = np.bincount(pixels_of(events), minlength=1600)
    assert counts.sum() == pytest.approx(rates.sum() * seconds, rel=0.03)
    assert np.corrcoef(counts, rates)[0, 1] > 0.95


def pixels_of(events):
    return events.y * events.width + events.x


def test_latencies_have_their_mean_and_jitter():
    frames = np.broadcast_to(np.array([100.0, 200.0])[:, None, None], (2, 64, 64))
    events = ICNS(**(CLEAN | {"jitter_us": 30.0})).simulate(frames, [0, 20_000])
    crossing = 0.4 / (math.log1p(200 / 255e-4) - math.log1p(100 / 255e-4)) * 20_000
    late = np.sort(events.t)[:4096] - crossing  # a single level is passed
    assert len(events) == 4096
    tau = 40 * 1000 / (100 * math.sqrt(2) / 255e-4)
    assert late.mean() == pytest.approx(100 + tau, abs=4 * 30 / 64 + 0.6)
    assert late.std() == pytest.approx(30.0, rel=0.05)


def test_thresholds_change_from_event_to_event():
    frames = np.broadcast_to(np.array([30.0, 60.0])[:, None, None], (2, 64, 64))
    model = ICNS(**(CLEAN | {"threshold_sigma_log": 0.03}), refractory_us=0, latency_us=0)
    events = model.simulate(np.concatenate([frames, frames[1:]]), [0, 20_000, 40_000])
    first = np.full(4096, 10**6)
    np.minimum.at(first, pixels_of(events), events.t)
    slope = (math.log1p(60 / 255e-4) - math.log1p(30 / 255e-4)) / 20_000
    # Half of the spread over the slope is cut off where an event would precede its crossing.
    spread = math.sqrt(0.03**2 * (1 + 0.5 - 0.5 / math.pi))
    assert first[first < 10**6].std() * slope == pytest.approx(spread, rel=0.06)


def test_no_latency_is_above_ten_milliseconds_in_the_dark():
    frames = np.array([0.0, 0.3, 0.3])[:, None, None]
    dark = CLEAN | {"white_lux": 255.0, "time_constant_us": 40.0}
    for mode in ("fixed", "faithful"):
        model = ICNS(**dark, threshold_on_log=0.2, mode=mode)
        events = model.simulate(frames, [0, 30_000, 90_000], white=255)
        assert len(events) == 1
        assert events.p[0] == 1
    assert events.t[0] == 40_000  # it came 44 ms after the light, 14 ms into the second step
