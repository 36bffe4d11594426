"""CARLA's pixel where it differs from ESIM's."""

import numpy as np
import pytest
from simulator_checks import rows

from eqs.simulators import CARLA, ESIM


@pytest.mark.parametrize("refractory", [0, 7_000])
def test_grey_frames_give_the_events_of_esim(walk, refractory):
    options = {"threshold_on_log": 0.3, "threshold_off_log": 0.3, "refractory_us": refractory}
    expected = rows(ESIM(**options).simulate(*walk))
    assert rows(CARLA(refractory_us=refractory).simulate(*walk)) == expected
    assert len(expected) > 500


@pytest.mark.parametrize("mode", ["fixed", "faithful"])
def test_the_first_interval_is_sound(mode):
    levels = 255 * np.exp(-0.3 * np.array([0, 2.5]))[:, None, None]
    events = CARLA(log_offset=1e-12, mode=mode).simulate(levels, [0, 100_000])
    np.testing.assert_allclose(events.t, [40_000, 80_000], atol=2)


@pytest.mark.parametrize("mode", ["fixed", "faithful"])
def test_a_linear_pixel_counts_grey_levels(mode):
    frames = np.array([10.0, 110.0, 10.0])[:, None, None]
    model = CARLA(logarithmic=False, threshold_on_log=30, threshold_off_log=40, mode=mode)
    events = model.simulate(frames, [0, 100_000, 200_000])
    # From 10 up to levels 40, 70 and 100, then down to 60 and 20.
    expected = [30_000, 60_000, 90_000, 150_000, 190_000]
    np.testing.assert_allclose(events.t, expected, atol=1)
    assert events.p.tolist() == [1, 1, 1, 0, 0]


def test_colour_keeps_its_fractions():
    frames = np.zeros((2, 1, 1, 3), np.uint8)
    frames[1, ..., 2] = 4  # 0.456 grey, which rounding would lose
    model = CARLA(logarithmic=False, threshold_on_log=0.4)
    assert len(model.simulate(frames, [0, 10])) == 1
