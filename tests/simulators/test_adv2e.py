"""ADV2E, a reconstruction: what its abstract claims, and the filter and noise it is built of."""

import math
from dataclasses import replace

import numpy as np
import pytest

from eqs.simulators import ADV2E, V2E, Prophesee
from eqs.simulators.pixel.first_passage import passage_rate

EXACT = ADV2E(threshold_sigma_log=0, voltage_noise_log=0, refractory_us=0, light=None)
BINS_US = 5000


def levels_of(light_log, dark=20.0):
    """Frames whose log light is given."""
    return 255 * np.exp(light_log) - dark


def on_the_line(frames, times, inserted, signal, inverse):
    """The clip with frames put in between on the straight line of a signal."""
    shares = np.arange(1, inserted + 1) / (inserted + 1)
    logs = signal(frames)
    parts = [frames[:1]]
    for first, last, image in zip(logs[:-1], logs[1:], frames[1:], strict=True):
        between = first + shares[:, None, None] * (last - first)
        parts += [inverse(between), image[None]]
    whole = np.arange((len(frames) - 1) * (inserted + 1) + 1)
    return np.concatenate(parts), np.interp(whole, whole[:: inserted + 1], times).round().astype(
        np.int64
    )


def clip(change=1.2, count=8, seed=0):
    """A walk of log light at 20 Hz, down to a tenth of white."""
    generator = np.random.default_rng(seed)
    log = np.cumsum(generator.uniform(-change, change, (count, 12, 12)), axis=0)
    log = np.abs((log - 1) % 4.0 - 2.0) - 2.2  # folded into -2.2 to -0.2
    return levels_of(log), 50_000 * np.arange(count)


def how_far(simulator, frames, times, inserted, signal, inverse):
    """Change in number, and share of events in another 5 ms, when frames are put in between."""
    plain = simulator.simulate(frames, times)
    dense = simulator.simulate(*on_the_line(frames, times, inserted, signal, inverse))
    counts = []
    for events in (plain, dense):
        bins = (events.t // BINS_US * 144 + events.y * 12 + events.x) * 2 + events.p
        counts.append(np.bincount(bins, minlength=2 * 144 * (times[-1] // BINS_US + 1)))
    moved = np.abs(counts[0] - counts[1]).sum() / (len(plain) + len(dense))
    return abs(len(dense) / len(plain) - 1), moved


@pytest.mark.parametrize("inserted", [1, 4, 9])
@pytest.mark.parametrize("law", ["small", "large"])
def test_frames_in_between_change_nothing(inserted, law):
    """The claim of its abstract: a cutoff that does not depend on the frame rate."""
    frames, times = clip()
    model = replace(EXACT, law=law, cutoff_hz=20)
    number, moved = how_far(
        model, frames, times, inserted, lambda f: np.log((f + 20) / 255), levels_of
    )
    assert number < 0.005
    assert moved < 0.06


@pytest.mark.parametrize(
    "simulator",
    [
        V2E(cutoff_hz=20, leak_hz=0, shot_noise_hz=0, threshold_sigma_log=0, refractory_us=0),
        Prophesee(cutoff_hz=20, leak_hz=0, shot_noise_hz=0, threshold_sigma_log=0),
    ],
    ids=lambda each: each.name,
)
def test_those_with_one_step_a_frame_depend_on_the_frame_rate(simulator):
    """At 20 Hz their filters go nearly all the way, at 200 Hz they do not."""
    frames, times = clip()
    frames = np.maximum(frames, 21.0)  # above the knee of v2e's logarithm
    for inserted in (1, 4, 9):
        number, moved = how_far(simulator, frames, times, inserted, np.log, np.exp)
        assert number > 0.1
        assert moved > 0.3


def crossing_us(model, before, after, share):
    """When the response to a step of one microsecond has gone a share of the way."""
    first, last = (math.log((level + 20) / 255) for level in (before, after))
    threshold = share * abs(last - first)
    model = replace(model, threshold_on_log=threshold, threshold_off_log=threshold)
    frames = np.array([[[before]], [[after]], [[after]]], float)
    return model.simulate(frames, [0, 1, 100_001], white=255).t[0]


@pytest.mark.parametrize(("level", "light"), [(255, 1.0), (0, 20 / 275)])
def test_the_step_response_has_the_corner_of_the_light(level, light):
    expected = 1e6 / (2 * math.pi * 300 * light)
    found = crossing_us(EXACT, level + (0.5 if level == 0 else -0.5), level, 1 - math.exp(-1))
    assert found == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(("second_hz", "gain", "lag_deg"), [(0, 0.707, 45), (300, 0.5, 90)])
def test_a_small_wave_at_the_corner_is_damped_and_late(second_hz, gain, lag_deg):
    """Amplitude and phase of one pole, and of two, at their corner."""
    middle = math.log(275 / 255) - 0.1
    model = replace(
        EXACT, threshold_on_log=0.0002, threshold_off_log=0.0002,
        cutoff_hz=300 / math.exp(-0.1), second_cutoff_hz=second_hz,
    )  # fmt: skip
    times = np.round(np.arange(30 * 64 + 1) * 1e6 / 300 / 64).astype(np.int64)
    wave = 0.04 * np.sin(2 * math.pi * 300e-6 * times)
    events = model.simulate(levels_of(middle + wave)[:, None, None], times)
    late = events.t > times[-1] // 3
    steps = np.where(events.p[late] == 1, 1, -1)
    heights = np.cumsum(steps) * 0.0002
    assert (heights.max() - heights.min()) / 2 == pytest.approx(0.04 * gain, rel=0.03)
    tops = np.flatnonzero(np.diff(steps) == -2)
    middles = (events.t[late][tops] + events.t[late][tops + 1]) / 2
    assert np.median((360 * 300e-6 * middles - 90) % 360) == pytest.approx(lag_deg, abs=2.5)


def test_a_slow_ramp_fires_a_threshold_apart_and_late_by_the_time_constant():
    change, span = 2.0, 2_000_000
    frames = levels_of(np.array([-2.2, -2.2 + change]))[:, None, None]
    events = EXACT.simulate(frames, [0, span])
    slope = change / span
    expected = np.arange(1, len(events) + 1) * 0.2 / slope
    late = events.t - expected
    light = np.exp(-2.2 + slope * expected) * 255 / 275
    np.testing.assert_allclose(late, 1e6 / (2 * math.pi * 300 * light), rtol=0.05)
    assert len(events) == 9  # the tenth would come after the end


def test_a_dark_pixel_goes_on_firing_after_an_edge_has_passed():
    """v2e's filter is there at the next frame, whatever its time constant; this one is not."""
    bright, dark = 200.0, 0.0
    frames = np.array([bright, dark] + [dark] * 40)[:, None, None]
    times = 50_000 * np.arange(len(frames))
    events = replace(EXACT, cutoff_hz=3).simulate(frames, times, white=255)
    contrast = math.log(220 / 20)
    assert len(events) == math.floor(contrast / 0.2)
    assert events.t[-1] > times[4]
    other = V2E(threshold_sigma_log=0, refractory_us=0, leak_hz=0, shot_noise_hz=0)
    assert other.simulate(frames, times, white=255).t[-1] <= times[1]


def test_events_in_the_refractory_period_wait_for_its_end():
    frames = levels_of(np.array([-2.0, 0.0]))[:, None, None]
    eager = EXACT.simulate(frames, [0, 20_000])
    patient = replace(EXACT, refractory_us=3000).simulate(frames, [0, 20_000])
    assert np.diff(patient.t).min() >= 3000
    assert len(patient) < len(eager)
    still = np.concatenate([frames, np.repeat(frames[1:], 9, axis=0)])
    both = [
        len(each.simulate(still, 20_000 * np.arange(11)))
        for each in (EXACT, replace(EXACT, refractory_us=3000))
    ]
    assert both[0] == both[1]


def test_without_noise_the_seed_is_nothing_and_with_it_stamps_spread_by_it_over_the_slope():
    frames = np.broadcast_to(levels_of(np.array([-1.0, 0.0]))[:, None, None], (2, 100, 100))
    times = [0, 500_000]
    assert not EXACT.stochastic
    exact = EXACT.simulate(frames, times)
    noisy = replace(EXACT, voltage_noise_log=0.002, cutoff_hz=100).simulate(frames, times)
    clear = replace(EXACT, cutoff_hz=100).simulate(frames, times)
    assert len(noisy) == len(clear)
    order = [np.lexsort((each.t, each.x, each.y)) for each in (noisy, clear)]
    moved = (noisy.t[order[0]] - clear.t[order[1]])[2::4]  # the third event of each pixel
    light = math.exp(-0.4) * 255 / 275
    longest = 3e6 / (2 * math.pi * 100 * light)
    spread = 0.002 / (1.0 / 500_000)
    assert spread < longest / 2
    assert moved.std() == pytest.approx(spread, rel=0.05)
    assert abs(moved.mean()) < 0.05 * spread
    assert len(exact) == len(clear)


def test_noise_fires_still_pixels_at_its_rate_and_light_makes_it_quicker():
    still = np.broadcast_to(np.array([[[255.0] * 200, [30.0] * 200]]), (41, 2, 200))
    model = replace(EXACT, voltage_noise_log=0.06)
    events = model.simulate(still, 50_000 * np.arange(41), white=255)
    rates = [np.count_nonzero(events.y == row) / (200 * 2.0) for row in (0, 1)]
    barrier = 0.2 / 0.06
    time_us = 1e6 / (2 * math.pi * 300)
    expected = 2e6 * passage_rate(barrier) / time_us
    assert rates[0] == pytest.approx(expected, rel=0.06)
    assert rates[1] == pytest.approx(expected * 50 / 275, rel=0.12)
    assert events.p.mean() == pytest.approx(0.5, abs=0.03)
