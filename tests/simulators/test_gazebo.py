"""The Gazebo plugin against a scalar model."""

import numpy as np
import pytest
from simulator_checks import assert_agree

from eqs.simulators import Gazebo


def scalar_gazebo(frames, times, threshold):
    events = []
    for y, x in np.ndindex(frames.shape[1:]):
        levels = frames[:, y, x].astype(int).tolist()
        reference = levels[0]
        for level, time in zip(levels[1:], times[1:].tolist(), strict=True):
            if abs(level - reference) > threshold:
                events.append((time, y, x, int(level > reference)))
                reference = level
    return sorted(events)


@pytest.mark.parametrize("threshold", [3, 10, 40])
def test_random_walks_agree_with_a_scalar_model(walk, threshold):
    frames, times = walk
    events = Gazebo(threshold_level=threshold).simulate(frames, times)
    assert_agree(events, scalar_gazebo(frames, times, threshold), 100)


def test_faithful_polarity_is_inverted(walk):
    fixed, faithful = (Gazebo(mode=mode).simulate(*walk) for mode in ("fixed", "faithful"))
    np.testing.assert_array_equal(faithful.p, 1 - fixed.p)
    np.testing.assert_array_equal(faithful.t, fixed.t)


def test_slow_drifts_add_up_and_the_threshold_must_be_exceeded():
    frames = np.uint8([100, 105, 110, 111, 121, 132])[:, None, None]
    events = Gazebo().simulate(frames, np.arange(6) * 1000)
    assert events.t.tolist() == [3000, 5000]  # 111 after 100, then 132 after 111 but not 121
