"""Prophesee against a scalar model, nominal noise rates, and its published defects."""

import math

import numpy as np
import pytest
from simulator_checks import assert_agree, assert_poisson, still

from eqs.simulators import Prophesee

CLEAN = {"threshold_sigma_log": 0.0, "shot_noise_hz": 0.0, "refractory_us": 0.0}


def scalar_prophesee(frames, times, model):
    """Two filters and robust crossings, one pixel after the other."""
    events = []
    on, off = model.threshold_on_log, model.threshold_off_log
    for y, x in np.ndindex(frames.shape[1:]):
        values = [max(float(value), 1.0) for value in frames[:, y, x]]
        inner = outer = reference = math.log(1e-7 + values[0] / 255)
        last = -math.inf
        for k in range(1, len(values)):
            t0, t1, light = times[k - 1], times[k], (float(frames[k, y, x]) + 20) / 275
            weight = min(1, light * 2 * math.pi * model.cutoff_hz * (t1 - t0) * 1e-6)
            weight = weight if model.cutoff_hz else 1
            before = outer
            inner += weight * (math.log(1e-7 + values[k] / 255) - inner)
            outer += weight * (inner - outer)
            while outer >= reference + on * (1 - 1e-9) or outer <= reference - off * (1 - 1e-9):
                up = outer > reference
                reference += on if up else -off
                share = (reference - before) / (outer - before) if outer != before else 0
                time = t0 + min(max(share, 0), 1) * (t1 - t0)
                if time - last >= model.refractory_us:
                    events.append((math.floor(time), y, x, int(up)))
                    last = time
    return sorted(events)


@pytest.mark.parametrize("refractory", [0, 7_000])
@pytest.mark.parametrize("cutoff", [0, 3])
def test_random_walks_agree_with_a_scalar_model(walk, cutoff, refractory):
    frames, times = walk
    model = Prophesee(**(CLEAN | {"cutoff_hz": cutoff, "refractory_us": refractory}))
    assert_agree(model.simulate(frames, times), scalar_prophesee(frames, times, model), 1000)


@pytest.mark.parametrize("level", [0, 200])
def test_fixed_shot_noise_has_its_nominal_rate_in_a_still_scene(level):
    model = Prophesee(**(CLEAN | {"shot_noise_hz": 4.0}), seed=level)
    events = model.simulate(still(level, 51, 24), np.arange(51) * 50_000)
    expected = 4.0 * (1 - 0.75 * (level + 20) / 275) * 24 * 24 * 2.5
    assert_poisson(len(events), expected)
    assert_poisson(int(events.p.sum()), expected / 2)


def test_fixed_leak_has_its_nominal_rate_and_faithful_leak_never_fires():
    frames, times = still(90, 201, 16), np.arange(201) * 50_000
    fixed = Prophesee(**CLEAN, leak_hz=1.0).simulate(frames, times)
    assert fixed.p.all()
    assert len(fixed) / 256 == pytest.approx(10, abs=0.1)
    assert len(Prophesee(**CLEAN, leak_hz=1.0, mode="faithful").simulate(frames, times)) == 0


def test_a_leak_blocks_faithful_events():
    swing = 60 * np.exp(np.sin(2 * np.pi * np.arange(600) / 100))
    frames, times = np.tile(swing[:, None, None], (1, 4, 4)), np.arange(600) * 10_000
    counts = {}
    for mode in ("fixed", "faithful"):
        plain = Prophesee(**CLEAN, mode=mode).simulate(frames, times)
        leaky = Prophesee(**CLEAN, mode=mode, leak_hz=1.0).simulate(frames, times)
        counts[mode] = len(leaky) / len(plain)
    assert counts["fixed"] == pytest.approx(1.0, abs=0.04)
    assert counts["faithful"] < 0.95


def test_faithful_shot_noise_needs_motion_and_is_shared_out_among_levels():
    options = CLEAN | {"shot_noise_hz": 10.0, "threshold_on_log": 0.2, "threshold_off_log": 0.2}
    quiet = Prophesee(**options, mode="faithful")
    frames, times = still(100, 101, 24), np.arange(101) * 10_000
    assert len(quiet.simulate(frames, times)) == 0
    moving = frames.astype(float)
    moving[:, 0, 0] = 100 * np.exp(np.arange(101) % 2 * 0.8 - 0.05)  # three levels a frame
    events = quiet.simulate(moving, times)
    noise = int((events.y * 24 + events.x > 0).sum())
    assert_poisson(noise, 10.0 * (1 - 0.75 * 120 / 275) * (24 * 24 - 1) * 1.0 / (3 + 1))


def test_black_flicker_drowns_faithful_pixels_alone():
    frames, times = np.arange(6)[:, None, None] % 2 * np.ones((6, 2, 2)), np.arange(6) * 50_000
    assert len(Prophesee(**CLEAN).simulate(frames, times, white=255)) == 0
    model = Prophesee(**CLEAN, threshold_on_log=0.2, mode="faithful")
    faithful = model.simulate(frames, times, white=255)
    step = math.log((1e-7 + 1 / 255) / 1e-7)
    assert len(faithful.window(0, 50_000)) == 4 * math.floor(step / 0.2)


def test_thresholds_stay_between_their_bounds():
    frames = np.stack([still(20, 1, 64)[0], still(250, 1, 64)[0]])
    model = Prophesee(**(CLEAN | {"threshold_sigma_log": 2.0}))
    events = model.simulate(frames, [0, 1_000_000])
    counts = np.zeros((64, 64), int)
    np.add.at(counts, (events.y, events.x), 1)
    rise = math.log(250 / 20)
    assert counts.min() == math.floor(rise / 1.0)
    assert counts.max() == math.floor(rise / 0.01)
