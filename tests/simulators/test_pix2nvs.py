"""PIX2NVS against a scalar model and the effects its two modes are known for."""

import math

import numpy as np
import pytest

from eqs.simulators import PIX2NVS
from eqs.simulators.pix2nvs import REFERENCE_UPDATES


def block_winner(signal, reference, top, left, block):
    pixels = [
        (y, x)
        for y in range(top, min(top + block, signal.shape[0]))
        for x in range(left, min(left + block, signal.shape[1]))
    ]
    return max(pixels, key=lambda pixel: abs(signal[pixel] - reference[pixel]))


def scalar_pix2nvs(frames, times, model):
    """The same rules on arrays, one block after the other."""
    signals = np.log(np.maximum(frames.astype(float), 1))
    reference = signals[0].copy()
    if model.reference_update == "integrate":
        reference[:] = 0
    threshold = np.full(reference.shape, model.threshold_log)
    events = []
    for signal, t0, t1 in zip(signals[1:], times[:-1], times[1:], strict=True):
        for top in range(0, signal.shape[0], model.block):
            for left in range(0, signal.shape[1], model.block):
                pixel = block_winner(signal, reference, top, left, model.block)
                difference, limit = signal[pixel] - reference[pixel], threshold[pixel]
                if abs(difference) <= limit:
                    threshold[pixel] = max((1 - model.adaptation) * limit, model.threshold_min_log)
                    continue
                count = min(int(abs(difference) / limit), model.max_events)
                for i in range(1, count + 1):
                    time = t0 + i * limit / abs(difference) * (t1 - t0)
                    events.append((math.floor(time), *pixel, int(difference > 0)))
                if model.reference_update == "replace":
                    reference[pixel] = signal[pixel]
                if model.reference_update == "integrate":
                    reference[pixel] += math.copysign(count * limit, difference)
                threshold[pixel] = min((1 + model.adaptation) * limit, model.threshold_max_log)
        if model.reference_update == "previous":
            reference = signal.copy()
    return sorted(events)


@pytest.mark.parametrize("update", REFERENCE_UPDATES)
@pytest.mark.parametrize("block", [1, 2, 4])
def test_random_walks_agree_with_a_scalar_model(walk, update, block):
    frames, times = walk[0][:, :15, :14], walk[1]  # not a multiple of the block
    model = PIX2NVS(reference_update=update, block=block)
    events = model.simulate(frames, times)
    found = sorted(
        zip(*(field.tolist() for field in (events.t, events.y, events.x, events.p)), strict=True)
    )
    expected = scalar_pix2nvs(frames, times.tolist(), model)
    assert len(found) == len(expected) > 50
    assert np.mean([one == other for one, other in zip(found, expected, strict=True)]) > 0.99


def flicker(sigma, frames=400, size=16):
    noise = np.random.default_rng(0).normal(0, sigma, (frames, size, size))
    return 40 * np.exp(noise), np.arange(frames) * 50_000


@pytest.mark.parametrize("sigma", [0.005, 0.05, 0.3])
def test_faithful_pixels_fire_in_half_the_frames_whatever_they_see(sigma):
    frames, times = flicker(sigma)
    events = PIX2NVS(mode="faithful").simulate(frames, times)
    late = events.window(200 * 50_000, 401 * 50_000)
    fired = np.zeros((200, 16, 16), bool)
    fired[np.minimum(late.t // 50_000 - 200, 199), late.y, late.x] = True
    assert fired.mean() == pytest.approx(0.51, abs=0.02)


def test_fixed_thresholds_stop_at_their_bounds():
    frames, times = flicker(0.02)
    assert len(PIX2NVS().simulate(frames, times)) == 0
    assert len(PIX2NVS(threshold_min_log=0.01).simulate(frames, times)) > 1000


def test_faithful_events_come_one_frame_late(walk):
    frames, times = walk[0], np.arange(len(walk[0])) * 50_000
    options = {"adaptation": 0.0, "threshold_log": 0.3}
    fixed = PIX2NVS(**options).simulate(frames, times)
    faithful = PIX2NVS(**options, mode="faithful").simulate(frames, times)
    assert len(fixed) == len(faithful) > 1000
    lag = np.sort(faithful.t) - np.sort(fixed.t)
    assert set(np.unique(lag)) <= {50_000, 50_001}  # rounded there, floored here


def test_contrast_beyond_the_cap_is_lost():
    frames = np.array([4.0, 4 * math.exp(3.9), 4 * math.exp(3.9)])[:, None, None]
    events = PIX2NVS(adaptation=0).simulate(frames, [0, 39_000, 78_000])
    np.testing.assert_allclose(events.t, 4000 * np.arange(1, 6), atol=1)
    kept = PIX2NVS(adaptation=0, reference_update="integrate", max_events=3)
    events = kept.simulate(np.repeat(frames, 8, axis=0), np.arange(24) * 1000)
    assert len(events) == math.floor((math.log(4) + 3.9) / 0.4)


def test_black_is_finite():
    frames = np.zeros((3, 2, 2), np.uint8)
    frames[1] = 200
    events = PIX2NVS(adaptation=0).simulate(frames, [0, 1000, 2000])
    assert events.window(0, 1000).p.all()
    assert len(events.window(0, 1000)) == len(events.window(1000, 2000)) == 20
