"""PECS: the light is the photodiode's, the circuit is ICNS's with a time constant of its own."""

import math
from dataclasses import fields

import numpy as np
import pytest

from eqs.frames import Light
from eqs.simulators import ICNS, PECS

QUIET = {"background_on_hz": 0, "background_off_hz": 0, "threshold_sigma_log": 0, "jitter_us": 0}
BLUE, RED = (0, 0, 255), (97, 0, 0)  # of equal luma


def clip(*colours):
    return np.array(colours, np.uint8).reshape(len(colours), 1, 1, 3)


def test_an_edge_between_colours_of_equal_luma_fires_on_silicon_alone():
    frames = clip(BLUE, RED)
    assert len(PECS(**QUIET, light=Light()).simulate(frames, [0, 50_000])) == 0
    events = PECS(**QUIET).simulate(frames, [0, 50_000])
    assert len(events) > 3
    assert not events.p.any()  # red is darker to silicon


def test_grey_in_colour_equals_grey():
    grey = np.random.default_rng(0).integers(0, 256, (4, 6, 8), np.uint8)
    times = 40_000 * np.arange(4)
    one = PECS(**QUIET).simulate(grey, times)
    other = PECS(**QUIET).simulate(np.repeat(grey[..., None], 3, axis=3), times)
    assert len(one) == len(other) > 50
    assert np.abs(np.sort(one.t) - np.sort(other.t)).max() <= 1


def test_the_step_response_at_white_reaches_its_share_after_300_us():
    """Of a step, theta is reached where 1 - exp(-t / tau) is its share."""
    step = math.log(256 / 200)
    model = PECS(
        **QUIET, light=None, latency_us=0, refractory_us=0,
        threshold_on_log=(1 - math.exp(-1)) * step, threshold_off_log=9,
    )  # fmt: skip
    frames = np.array([[[199.0]], [[255.0]], [[255.0]]])
    events = model.simulate(frames, [0, 1, 50_001])
    assert events.t[0] == pytest.approx(300, abs=3)


def test_the_circuit_is_that_of_icns():
    frames = np.random.default_rng(1).integers(0, 256, (5, 6, 8), np.uint8)
    times = 30_000 * np.arange(5)
    model = PECS(seed=4)
    values = {field.name: getattr(model, field.name) for field in fields(ICNS)}
    same = ICNS(**values)
    one, other = model.simulate(frames, times), same.simulate(frames, times)
    for name in "txyp":
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_there_is_no_program_to_be_faithful_to():
    with pytest.raises(ValueError, match=r"^Expected mode fixed for pecs, got faithful.*sim\.mode"):
        PECS(mode="faithful")
