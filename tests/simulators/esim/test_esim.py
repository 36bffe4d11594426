"""ESIM against closed forms, a scalar model, and the defects its faithful mode keeps."""

import math

import numpy as np
import pytest

from eqs.simulators import ESIM

TIGHT = 1e-9


def ramp(frames, thresholds, threshold=0.2, span_us=100_000):
    """One pixel whose log intensity falls from white by `thresholds` over equal intervals."""
    shares = np.linspace(0, 1, frames)
    levels = 255 * np.exp(-threshold * thresholds * shares)
    return levels[:, None, None], np.round(shares * span_us).astype(int)


def scalar_esim(frames, times, on, off, offset, refractory):
    """The same model, one pixel after the other, without any of its code."""
    events = []
    for y, x in np.ndindex(frames.shape[1:]):
        signal = [math.log(offset + float(value) / 255) for value in frames[:, y, x]]
        reference, last = signal[0], -math.inf
        for k in range(1, len(signal)):
            first, end, t0, t1 = signal[k - 1], signal[k], times[k - 1], times[k]
            while end >= reference + on * (1 - TIGHT) or end <= reference - off * (1 - TIGHT):
                up = end > reference
                reference += on if up else -off
                share = (reference - first) / (end - first) if end != first else 0
                time = t0 + min(max(share, 0), 1) * (t1 - t0)
                if time - last >= refractory:
                    events.append((math.floor(time), y, x, int(up)))
                    last = time
    return sorted(events)


@pytest.mark.parametrize("refractory", [0, 7_000])
@pytest.mark.parametrize(("on", "off"), [(0.2, 0.2), (0.31, 0.13)])
def test_random_walks_agree_with_a_scalar_model(walk, on, off, refractory):
    frames, times = walk
    model = ESIM(threshold_on_log=on, threshold_off_log=off, refractory_us=refractory)
    events = model.simulate(frames, times)
    found = sorted(
        zip(*(field.tolist() for field in (events.t, events.y, events.x, events.p)), strict=True)
    )
    expected = scalar_esim(frames, times.tolist(), on, off, 1e-3, refractory)
    assert len(found) == len(expected) > 1000
    np.testing.assert_allclose(found, expected, atol=1)  # a rounding error may cross a microsecond
    assert np.mean(np.array(found)[:, 0] == np.array(expected)[:, 0]) > 0.99


@pytest.mark.parametrize(
    ("mode", "frames"), [("fixed", 2), ("fixed", 5), ("fixed", 40), ("faithful", 40)]
)
def test_a_ramp_fires_at_multiples_of_the_threshold(mode, frames):
    levels, times = ramp(frames, thresholds=7.5)
    events = ESIM(log_offset=1e-12, mode=mode).simulate(levels, times)
    assert events.p.tolist() == [0] * 7
    expected = np.arange(1, 8) / 7.5 * 100_000
    np.testing.assert_allclose(events.t, expected, atol=1 if mode == "fixed" else 3)


def test_a_step_of_whole_thresholds_gives_as_many_events():
    levels, times = ramp(2, thresholds=7)
    events = ESIM(log_offset=1e-12).simulate(levels, times)
    assert len(events) == 7
    assert events.t[-1] in (99_999, 100_000)


def test_swapped_thresholds_mirror_the_polarity(walk):
    frames, times = walk
    levels = np.linspace(-4, 0, 256)
    down = levels[0] + levels[-1] - levels  # the mirrored log intensity
    grey, mirrored = 255 * np.exp(levels)[frames], 255 * np.exp(down)[frames]
    one = ESIM(threshold_on_log=0.15, threshold_off_log=0.25, log_offset=1e-12)
    other = ESIM(threshold_on_log=0.25, threshold_off_log=0.15, log_offset=1e-12)
    first, second = one.simulate(grey, times), other.simulate(mirrored, times)
    assert len(first) == len(second) > 500
    assert first.p.sum() == len(second) - second.p.sum()
    assert np.mean(np.abs(first.t - second.t) <= 1) > 0.999


def test_a_repeated_frame_changes_nothing(walk):
    frames, times = walk
    doubled = np.repeat(frames, 2, axis=0)
    rests = np.stack([times, times + 1000], axis=1).ravel()
    counts = []
    for events in (ESIM().simulate(frames, times), ESIM().simulate(doubled, rests)):
        counts.append(np.zeros((2, *frames.shape[1:]), int))
        np.add.at(counts[-1], (events.p, events.y, events.x), 1)
    np.testing.assert_array_equal(*counts)


def test_refractory_pixels_drop_crossings_and_forget_them():
    levels, times = ramp(2, thresholds=9.5, span_us=95_000)  # a crossing each 10 ms
    events = ESIM(log_offset=1e-12, refractory_us=25_000).simulate(levels, times)
    np.testing.assert_allclose(events.t, [10_000, 40_000, 70_000], atol=1)


def test_mismatch_has_the_spread_it_was_given():
    height, width = 100, 100
    levels = np.linspace(255, 255 * math.exp(-2.0), 2)
    frames = np.broadcast_to(levels[:, None, None], (2, height, width))
    model = ESIM(log_offset=1e-12, threshold_sigma_log=0.02, seed=1)
    events = model.simulate(frames, [0, 1_000_000])
    first = np.full((height, width), 1_000_000)
    np.minimum.at(first, (events.y, events.x), events.t)
    # The interval is linear in the log, so the first event comes at threshold / 2 seconds.
    thresholds = first.ravel() * 2e-6
    assert thresholds.mean() == pytest.approx(0.2, abs=4 * 0.02 / 100)
    assert thresholds.std() == pytest.approx(0.02, rel=0.04)


def sinusoid(frames=600, per_period=100, pixels=400):
    """Pixels in step whose log intensity swings by one unit either way."""
    signal = np.sin(2 * np.pi * np.arange(frames) / per_period) - 1
    grey = 255 * np.exp(signal)
    return np.broadcast_to(grey[:, None, None], (frames, 1, pixels)), np.arange(frames) * 1000


def test_faithful_threshold_noise_loses_the_published_share_of_events():
    frames, times = sinusoid()
    clean = len(ESIM(mode="faithful", log_offset=1e-12).simulate(frames, times))
    for sigma, share in ((0.006, 0.59), (0.02, 0.30), (0.03, 0.23)):
        noisy = ESIM(mode="faithful", log_offset=1e-12, threshold_sigma_log=sigma)
        assert len(noisy.simulate(frames, times)) / clean == pytest.approx(share, abs=0.05)
        mended = ESIM(log_offset=1e-12, threshold_sigma_log=sigma)
        assert len(mended.simulate(frames, times)) / clean == pytest.approx(1.03, abs=0.08)


def test_the_faithful_first_interval_shares_its_buffer():
    levels, times = ramp(2, thresholds=2.5)
    fixed = ESIM(log_offset=1e-12).simulate(levels, times)
    np.testing.assert_allclose(fixed.t, [40_000, 80_000], atol=1)
    faithful = ESIM(log_offset=1e-12, mode="faithful").simulate(levels, times)
    np.testing.assert_allclose(faithful.t, [40_000, 66_667], atol=2)
