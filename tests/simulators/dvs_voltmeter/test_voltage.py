"""Voltages moved together and one by one."""

import numpy as np
import pytest

from eqs.simulators.dvs_voltmeter.voltage import Motion, fire, move_quiet
from eqs.simulators.pixel.randomness import draw_key
from eqs.simulators.streaming.keys import TIME_SHIFT

PIXELS, SPAN_US = 3_000, 50_000
CAMERA = Motion(5.265, 20.0, 1e-7, 5e-9, 1e-4, 1e-5)
LEVELS = np.arange(256.0)


def scene(seed=0):
    """Codes at either end of an interval, many without change, and voltages up to the barriers."""
    generator = np.random.default_rng(seed)
    start = generator.integers(0, 256, PIXELS).astype(np.uint8)
    change = generator.choice([0, 0, 1, -1, 5, -20], PIXELS)
    end = np.clip(start.astype(int) + change, 0, 255).astype(np.uint8)
    voltage = generator.uniform(-1, 1, PIXELS)
    voltage[:3] = -1.0, 1.0, 0.0
    return (start, LEVELS), (end, LEVELS), voltage


def fired(chosen, voltage, motion, seed=0):
    """Keys of the events of some pixels."""
    start, end, _ = scene(seed)
    buffer = np.empty(1, np.int64)
    key = draw_key(seed, "motion")
    keys, count = fire(chosen, start, end, voltage, motion, False, key, 0, SPAN_US, buffer)
    return keys[:count]


@pytest.mark.parametrize(
    "motion",
    [
        CAMERA,
        CAMERA._replace(thermal_noise_per_sqrt_us=1e-2),
        CAMERA._replace(leak_per_us=0.0, light_leak_per_us=0.0),
        CAMERA._replace(photon_noise_per_sqrt_us=0.0, thermal_noise_per_sqrt_us=0.0),
        CAMERA._replace(gain=0.0, leak_per_us=0.0, light_leak_per_us=0.0),
    ],
    ids=["camera", "noisy", "without leak", "without noise", "without drift"],
)
def test_quiet_pixels_move_as_they_do_one_by_one(motion):
    start, end, voltage = scene()
    one_by_one = voltage.copy()
    everyone = np.arange(PIXELS, dtype=np.int32)
    expected = fired(everyone, one_by_one, motion)
    others = np.empty(PIXELS, np.int32)
    left = move_quiet(start, end, voltage, motion, draw_key(0, "motion"), SPAN_US, others)
    assert np.array_equal(fired(others[:left], voltage, motion), expected)
    assert np.array_equal(voltage, one_by_one)


def test_most_pixels_of_a_camera_are_moved_together():
    start, end, voltage = scene()
    others = np.empty(PIXELS, np.int32)
    left = move_quiet(start, end, voltage, CAMERA, draw_key(0, "motion"), SPAN_US, others)
    firing = np.unique(fired(others[:left], voltage.copy(), CAMERA) & ((1 << TIME_SHIFT) - 2)).size
    assert firing < left < firing + 0.1 * PIXELS
