"""V2E against closed forms, a scalar model, nominal noise rates, and its published defects."""

import math

import numpy as np
import pytest

from eqs.simulators import V2E
from eqs.simulators.pixel.photoreceptor import lin_log

CLEAN = {"threshold_sigma_log": 0.0, "cutoff_hz": 0.0, "leak_hz": 0.0, "shot_noise_hz": 0.0}


def photoreceptor(level):
    return round(level * math.log(20) / 20 if level <= 20 else math.log(level), 8)


def scalar_v2e(frames, times, on, off, cutoff, refractory):
    """Filter and continuous-time crossings, one pixel after the other."""
    events = []
    for y, x in np.ndindex(frames.shape[1:]):
        values = [float(value) for value in frames[:, y, x]]
        state = memory = photoreceptor(values[0])
        last = -math.inf
        for k in range(1, len(values)):
            t0, t1 = times[k - 1], times[k]
            before, light = state, (values[k] + 20) / 275
            weight = min(1, light * 2 * math.pi * cutoff * (t1 - t0) * 1e-6) if cutoff else 1
            state = (1 - weight) * before + weight * photoreceptor(values[k])
            while True:
                up = state >= memory + on * (1 - 1e-9)
                if not up and state > memory - off * (1 - 1e-9):
                    break
                target = memory + (on if up else -off)
                share = (target - before) / (state - before) if state != before else 0
                time = max(t0 + min(max(share, 0), 1) * (t1 - t0), last + refractory)
                if time > t1:
                    break
                memory, last = target, time
                events.append((math.floor(time), y, x, int(up)))
    return sorted(events)


@pytest.mark.parametrize("refractory", [0, 7_000])
@pytest.mark.parametrize("cutoff", [0, 3])
def test_random_walks_agree_with_a_scalar_model(walk, cutoff, refractory):
    frames, times = walk
    model = V2E(**(CLEAN | {"cutoff_hz": cutoff}), threshold_off_log=0.3, refractory_us=refractory)
    events = model.simulate(frames, times)
    found = sorted(
        zip(*(field.tolist() for field in (events.t, events.y, events.x, events.p)), strict=True)
    )
    expected = scalar_v2e(frames, times.tolist(), 0.2, 0.3, cutoff, refractory)
    assert len(found) == len(expected) > 500
    assert np.mean([one == other for one, other in zip(found, expected, strict=True)]) > 0.99


def test_the_photoreceptor_is_continuous_and_increasing():
    levels = np.arange(256.0)
    signal = lin_log(levels)
    assert (np.diff(signal) > 0).all()
    assert np.diff(signal).max() == pytest.approx(0.1498, abs=1e-4)
    np.testing.assert_allclose(signal[21:], np.log(levels[21:]), atol=1e-8)


def test_a_step_decays_through_the_filter():
    frames = np.full((4, 1, 1), 255.0)
    frames[0] = 100.0
    model = V2E(**(CLEAN | {"cutoff_hz": 2.0}), threshold_on_log=0.1, refractory_us=0)
    events = model.simulate(frames, np.arange(4) * 20_000)
    share = 2 * math.pi * 2.0 * 0.02  # of the rest, at each frame
    reached = math.log(255 / 100) * (1 - (1 - share) ** np.arange(1, 4))
    counts = [len(events.window(k * 20_000, (k + 1) * 20_000)) for k in range(3)]
    np.testing.assert_array_equal(np.cumsum(counts), np.floor(reached / 0.1))


def test_the_default_filter_is_inert_at_video_rate(walk):
    frames, times = walk
    noiseless = {"threshold_sigma_log": 0.0, "leak_hz": 0.0, "shot_noise_hz": 0.0}
    filtered = V2E(**noiseless).simulate(frames, times)
    plain = V2E(**noiseless, cutoff_hz=0).simulate(frames, times)
    np.testing.assert_array_equal(filtered.t, plain.t)


def test_the_refractory_period_delays_events_and_keeps_contrast():
    frames = np.array([50.0, 50.0 * math.exp(1.05)])[:, None, None]
    frames = np.concatenate([frames, frames[1:], frames[1:]])
    model = V2E(**CLEAN, refractory_us=25_000)
    events = model.simulate(frames, np.arange(4) * 50_000)
    np.testing.assert_allclose(events.t, 9524 + 25_000 * np.arange(5), atol=1)


def still(level, frames, size):
    return np.full((frames, size, size), level, np.uint8)


def assert_poisson(count, expected):
    assert abs(count - expected) < 4 * math.sqrt(expected)


@pytest.mark.parametrize("mode", ["fixed", "faithful"])
@pytest.mark.parametrize("gap_us", [10_000, 50_000])
@pytest.mark.parametrize("level", [0, 200])
def test_shot_noise_has_its_nominal_rate(mode, gap_us, level):
    model = V2E(**(CLEAN | {"shot_noise_hz": 2.0}), mode=mode, refractory_us=0, seed=gap_us)
    frames = still(level, 101, 24)
    events = model.simulate(frames, np.arange(101) * gap_us)
    share = 1 - 0.75 * (level + 20) / 275
    expected = 2.0 * share * 24 * 24 * 100 * gap_us * 1e-6
    assert_poisson(len(events), expected)
    assert_poisson(int(events.p.sum()), expected / 2)


def test_fixed_shot_noise_keeps_its_rate_where_probabilities_would_exceed_one():
    model = V2E(**(CLEAN | {"shot_noise_hz": 100.0}), refractory_us=0)
    events = model.simulate(still(0, 21, 12), np.arange(21) * 100_000)
    expected = 100.0 * (1 - 0.75 * 20 / 275) * 144 * 2
    assert_poisson(len(events), expected)
    phase = np.histogram(events.t % 100_000, bins=10)[0]
    assert np.sum((phase - expected / 10) ** 2 / (expected / 10)) < 28  # chi2, 9 degrees, 0.999


@pytest.mark.parametrize("mode", ["fixed", "faithful"])
def test_the_leak_has_its_nominal_rate_and_fires_on_only(mode):
    model = V2E(**(CLEAN | {"leak_hz": 0.5}), mode=mode, leak_spread_decades=0, refractory_us=0)
    events = model.simulate(still(90, 401, 16), np.arange(401) * 50_000)  # 20 s
    assert events.p.all()
    # Each pixel's phase is uniform in fixed mode: 10 events, one more or one less at the ends.
    mean = len(events) / 256
    assert mean == pytest.approx(10, abs=0.1 if mode == "fixed" else 0.6)


def test_fixed_leaks_start_at_random_phases_and_faithful_ones_in_step():
    spread = {}
    for mode in ("fixed", "faithful"):
        model = V2E(**(CLEAN | {"leak_hz": 0.5}), mode=mode, refractory_us=0)
        events = model.simulate(still(90, 31, 32), np.arange(31) * 50_000)
        spread[mode] = len(events) / 1024
    assert spread["fixed"] == pytest.approx(0.75, abs=0.06)  # 1.5 s at 0.5 Hz
    assert spread["faithful"] < 0.2  # nearly no pixel is faster than 2 s by a fifth


def test_leak_rates_spread_over_decades():
    model = V2E(**(CLEAN | {"leak_hz": 5.0}), leak_spread_decades=0.1, leak_jitter=0)
    frames = still(90, 201, 32)
    events = model.simulate(frames, np.arange(201) * 100_000)  # 20 s
    counts = np.zeros((32, 32))
    np.add.at(counts, (events.y, events.x), 1)
    decades = np.log10(counts / 100)
    assert decades.mean() == pytest.approx(0, abs=0.015)
    assert decades.std() == pytest.approx(0.1, rel=0.1)


def test_faithful_stamps_are_set_by_the_busiest_pixel():
    frames = np.full((2, 1, 2), 50.0)
    frames[1, 0] = 50 * math.exp(0.25), 50 * math.exp(0.85)
    faithful = V2E(**CLEAN, mode="faithful").simulate(frames, [0, 40_000])
    assert sorted(faithful.t[faithful.x == 0].tolist()) == [10_000]
    assert sorted(faithful.t[faithful.x == 1].tolist()) == [10_000, 20_000, 30_000, 40_000]
    fixed = V2E(**CLEAN).simulate(frames, [0, 40_000])
    np.testing.assert_allclose(fixed.t[fixed.x == 0], 0.2 / 0.25 * 40_000, atol=1)


def test_the_faithful_refractory_period_works_only_on_fine_grids():
    frames = np.array([50.0, 50 * math.exp(0.85)])[:, None, None]
    coarse = V2E(**CLEAN, mode="faithful", refractory_us=9_000).simulate(frames, [0, 40_000])
    assert len(coarse) == 4
    fine = V2E(**CLEAN, mode="faithful", refractory_us=15_000).simulate(frames, [0, 40_000])
    assert fine.t.tolist() == [10_000, 30_000]
