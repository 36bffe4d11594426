"""Improved ESIM against a scalar model, SciPy's linear systems, and closed forms."""

import math

import numpy as np
import pytest
from scipy.signal import StateSpace, lsim
from simulator_checks import assert_agree, rows, still

from eqs.frames import GreyImage
from eqs.simulators import ESIM, ImprovedESIM
from eqs.simulators.improved_esim.bandwidth import Photoreceptor, PixelFilter

DARK_SHARE = 4 / 2000


def scalar_improved(frames, times, model, blind):
    """Reset to the signal, one pixel after the other, on absolute times."""
    events = []
    leak = model.leak_hz * model.threshold_on_log * 1e-6
    for y, x in np.ndindex(frames.shape[1:]):
        signal = np.log(frames[:, y, x] / 255 + DARK_SHARE)

        def at(time, signal=signal):
            return float(np.interp(time, times, signal)) + leak * time

        now = float(blind[y, x])
        reset = at(now)
        for stop in times[1:].tolist():
            while now < stop:
                rise = (at(stop) - at(now)) / (stop - now)
                step = model.threshold_on_log if rise > 0 else -model.threshold_off_log
                wait = (step - (at(now) - reset)) / rise if rise else math.inf
                if now + wait > stop:
                    now = float(stop)
                    break
                now += wait
                events.append((math.floor(now), y, x, int(rise > 0)))
                now += model.refractory_us
                reset = at(min(now, times[-1]))
    return sorted(events)


def test_without_bandwidth_and_blindness_it_is_esim(walk):
    model = ImprovedESIM(order=0)
    plain = ESIM(threshold_on_log=0.25, threshold_off_log=0.25, log_offset=DARK_SHARE)
    assert_agree(model.simulate(*walk), rows(plain.simulate(*walk)), 1000)


def test_random_walks_with_blindness_agree_with_a_scalar_model(walk):
    frames, times = walk
    times = times - times[0]
    model = ImprovedESIM(order=0, threshold_off_log=0.2, refractory_us=9000)
    blind = model.begin(GreyImage.from_frame(frames[0]), "").ready_us.reshape(16, 16)
    expected = scalar_improved(frames, times, model, blind)
    assert_agree(model.simulate(frames, times), expected, 1000)


def test_a_pixel_is_reset_to_what_it_sees_after_its_blindness():
    share = np.array([0.0, 1.0])
    levels = 255 * np.exp(-0.25 * 9.5 * share)[:, None, None]
    tiny = {"dark_current_fa": 1e-9, "order": 0}
    events = ImprovedESIM(**tiny, refractory_us=25_000).simulate(levels, [0, 95_000])
    assert 10_000 <= events.t[0] <= 35_000  # after the first, random blindness
    np.testing.assert_allclose(np.diff(events.t), 35_000, atol=1)


def test_first_blindness_is_uniform():
    levels = 255 * np.exp(-np.array([0.0, 2.0]))[:, None, None]
    frames = np.broadcast_to(levels, (2, 64, 64))
    model = ImprovedESIM(dark_current_fa=1e-9, order=0, refractory_us=20_000)
    events = model.simulate(frames, [0, 80_000])
    first = np.full(4096, 10**6)
    np.minimum.at(first, events.y * 64 + events.x, events.t)
    counts = np.histogram(first - 10_000, bins=8, range=(0, 20_000))[0]
    assert counts.sum() == 4096
    assert np.sum((counts - 512) ** 2 / 512) < 24.3  # chi2, 7 degrees, 0.999


@pytest.mark.parametrize("order", [0, 4])
def test_the_leak_is_exact_and_absent_in_faithful_mode(order):
    frames, times = still(90, 101, 24), np.arange(101) * 100_000
    events = ImprovedESIM(leak_hz=0.7, order=order).simulate(frames, times)
    assert events.p.all()
    assert len(events) / 576 == pytest.approx(7.0, abs=0.1)
    gaps = np.diff(events.t[(events.x == 3) & (events.y == 5)])
    np.testing.assert_allclose(gaps, 1e6 / 0.7, atol=1)
    assert len(ImprovedESIM(leak_hz=0.7, mode="faithful").simulate(frames, times)) == 0


def circuit(model, level):
    """The same circuit as matrices, in seconds."""
    equation = Photoreceptor.at(model, np.array([level]))
    damping, stiffness = equation.damping[0] * 1e6, equation.stiffness[0] * 1e12
    follower, amplifier = (
        2 * math.pi * cutoff for cutoff in (model.source_follower_hz, model.amplifier_hz)
    )
    motion = np.array(
        [
            [0, 1, 0, 0],
            [-stiffness, -damping, 0, 0],
            [follower, 0, -follower, 0],
            [0, 0, amplifier, -amplifier],
        ]
    )
    return StateSpace(motion, [[0], [stiffness], [0], [0]], [[1, 0, 0, 0]], [[0]])


@pytest.mark.parametrize("white", [20.0, 2000.0, 1e6])
@pytest.mark.parametrize("span", [50, 1000, 20_000])
def test_the_photoreceptor_follows_ramps_exactly(white, span):
    model = ImprovedESIM(white_current_fa=white, order=2)
    images = [GreyImage.from_frame(np.full((1, 1), v)) for v in (50.0, 120.0, 120.0, 120.0)]
    pixels = PixelFilter(model, images[0])
    found = [float(pixels.output[0])] + [
        float(pixels.advance(image, span)[0]) for image in images[1:]
    ]
    light = model.signal(np.array([50.0, 120.0, 120.0, 120.0]))
    start = [light[0], 0, 0, 0]
    _, expected, _ = lsim(circuit(model, 120.0), light, np.arange(4) * span * 1e-6, X0=start)
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_four_orders_tend_to_the_whole_circuit_on_fine_frames():
    model = ImprovedESIM()
    grey = np.concatenate([[50.0], np.full(400, 120.0)])
    images = [GreyImage.from_frame(np.full((1, 1), value)) for value in grey]
    pixels = PixelFilter(model, images[0])
    found = [float(pixels.advance(image, 5)[0]) for image in images[1:]]
    light = model.signal(grey)
    system = circuit(model, 120.0)
    whole = StateSpace(system.A, system.B, [[0, 0, 0, 1]], [[0]])
    _, expected, _ = lsim(whole, light, np.arange(401) * 5e-6, X0=[light[0], 0, light[0], light[0]])
    np.testing.assert_allclose(found, expected[1:], atol=2e-3)
    assert np.ptp(expected) > 0.5


def test_the_bandwidth_grows_with_the_light():
    frames = np.stack([still(40, 1, 4)[0], *still(80, 30, 4)])
    times = np.arange(31) * 1000
    last = [
        int(ImprovedESIM(white_current_fa=white).simulate(frames, times).t.max())
        for white in (20.0, 200.0, 2000.0)
    ]
    assert last[0] > last[1] > last[2]


def test_black_stands_still_in_faithful_mode_alone():
    frames = np.stack([still(90, 1, 4)[0], *still(0, 30, 4)])
    times = np.arange(31) * 50_000
    assert len(ImprovedESIM(mode="faithful").simulate(frames, times)) == 0
    assert len(ImprovedESIM().simulate(frames, times)) > 16 * 10
