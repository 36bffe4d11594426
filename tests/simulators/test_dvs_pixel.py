"""The physical pixel: its law, its noise, its leak, and whose relative it is."""

import math
from dataclasses import replace

import numpy as np
import pytest

from eqs.simulators import DVSPixel
from eqs.simulators.pixel.first_passage import passage_rate

IDEAL = DVSPixel(
    threshold_sigma_log=0, noisy=False, leak_hz=0, leak_hz_at_white=0, light=None, refractory_us=0
)


def half_way_us(before, after, **changed):
    """When the response to a step of one microsecond is half way."""
    current = [
        IDEAL.white_current_fa * level / 255 + IDEAL.dark_current_fa for level in (before, after)
    ]
    threshold = 0.5 * abs(math.log(current[1] / current[0]))
    model = replace(IDEAL, threshold_on_log=threshold, threshold_off_log=threshold, **changed)
    frames = np.array([[[before]], [[after]], [[after]]], float)
    return model.simulate(frames, [0, 1, 200_001], white=255).t[0]


@pytest.mark.parametrize("contrast", [0.25, 1.0, 2.0])
def test_the_photodiode_brightens_quickly_and_darkens_slowly(contrast):
    """Half times of the large-signal law in closed form, behind a source follower that is fast."""
    low = 255 * (math.exp(-contrast) * 505 - 5) / 500
    slow = {"photodiode_hz": 20.0, "source_follower_hz": 1e6}
    rate = 2 * math.pi * 20 * 1e-6
    for before, after in ((low, 255.0), (255.0, low)):
        u = contrast if after == 255 else -contrast
        speed = rate * (1.0 if after == 255 else math.exp(-contrast))
        way = (1 - math.exp(-u)) / (math.exp(-u / 2) - math.exp(-u))
        assert half_way_us(before, after, **slow) == pytest.approx(math.log(way) / speed, rel=0.03)


def test_noise_events_come_at_the_rate_of_first_passages_and_most_in_between():
    levels = np.array([0.0, 3.0, 30.0, 255.0])
    model = replace(IDEAL, noisy=True, white_current_fa=150.0, photodiode_hz=3000.0)
    still = np.broadcast_to(np.repeat(levels, 300)[None, None, :], (61, 2, 1200))
    events = model.simulate(still, 50_000 * np.arange(61), white=255)
    rates = np.bincount(events.x // 300, minlength=4) / (2 * 300 * 3.0)
    from eqs.frames import GreyImage

    seen = model.seen(GreyImage.from_frame(levels[None]))
    expected = [
        2 * passage_rate(0.25 / noise) / (time * 1e-6)
        for noise, time in zip(seen.noise_log, seen.noise_us, strict=True)
    ]
    np.testing.assert_allclose(rates, expected, rtol=0.2)
    assert rates[2] > rates[0]
    assert np.diff(seen.noise_log).max() <= 0  # the less light, the more noise


def test_the_noise_of_dim_light_does_not_depend_on_it():
    from eqs.frames import GreyImage

    model = replace(IDEAL, noisy=True, photodiode_hz=100.0)
    seen = model.seen(GreyImage.from_frame(np.array([[0.0, 10.0]])))
    limit = math.sqrt(4 * 1.602e-4 * math.pi / 2 * 100 / (500 + 5))
    assert seen.noise_log == pytest.approx([limit, limit], rel=0.02)


def test_the_leak_fires_on_events_at_its_rate_and_faster_in_the_light():
    model = replace(IDEAL, leak_hz=2.0, leak_hz_at_white=4.0)
    still = np.broadcast_to(np.array([[[0.0] * 8, [255.0] * 8]]), (101, 2, 8))
    events = model.simulate(still, 50_000 * np.arange(101), white=255)
    assert events.p.all()
    counts = np.bincount(events.y, minlength=2) / 8
    assert counts[0] == pytest.approx(10, abs=1)
    assert counts[1] == pytest.approx(30, abs=1)
    assert np.diff(events.t[(events.y == 0) & (events.x == 0)]) == pytest.approx(500_000, rel=1e-3)


def test_the_source_follower_delays_a_ramp_by_its_time_constant():
    frames = np.array([[[5.0]], [[250.0]]])
    slow = {"photodiode_hz": 1e6, "threshold_on_log": 0.2}
    sharp, late = (
        replace(IDEAL, **slow, source_follower_hz=corner).simulate(frames, [0, 1_000_000]).t
        for corner in (1e6, 50.0)
    )
    count = min(len(sharp), len(late))
    assert count > 5
    assert (late[:count] - sharp[:count])[2:] == pytest.approx(1e6 / (2 * math.pi * 50), rel=0.05)


def test_a_pixel_takes_the_signal_after_its_dead_time():
    """A change within the dead time is lost, where ADV2E would make up for it."""
    frames = np.array([[[20.0]], [[120.0]], [[120.0]]])
    times = [0, 2_000, 100_000]
    all_of_it = replace(IDEAL, photodiode_hz=1e5, source_follower_hz=1e5)
    few = replace(all_of_it, refractory_us=5_000).simulate(frames, times)
    assert len(few) == 1
    assert len(all_of_it.simulate(frames, times)) > 3


def test_it_is_marked_where_its_relative_judges():
    assert "same family" in IDEAL.caveat("dsec_mini")
    assert IDEAL.caveat("dsec") == ""
