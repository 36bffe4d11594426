"""Vid2E and every other simulator on interpolated frames."""

import itertools

import numpy as np
import pytest

from eqs.frames import FlowInterpolation, LinearInterpolation
from eqs.simulators import ESIM, PIX2NVS, Vid2E

TIMES = np.array([0, 40_000, 110_000])


@pytest.fixture
def clip():
    columns = np.arange(64)
    rows = 1 + 0.1 * np.sin(np.arange(48) / 3.0)[:, None]  # without any, flow has no hold
    return np.stack(
        [rows * (30 + 180 * np.exp(-(((columns - at) / 4.0) ** 2))) for at in (20.0, 24.0, 30.0)]
    ).astype(np.uint8)


def same(a, b):
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in "txyp")


def test_a_simulator_sees_the_frames_between(clip):
    interpolation = LinearInterpolation(factor=4)
    between = [interpolation.between(a, b) for a, b in itertools.pairwise(clip)]
    dense = np.concatenate([clip[:1], between[0], clip[1:2], between[1], clip[2:]])
    times = [0, 10_000, 20_000, 30_000, 40_000, 57_500, 75_000, 92_500, 110_000]
    for kind in (ESIM, PIX2NVS):
        expected = kind().simulate(dense, times)
        assert same(kind(interpolation=interpolation).simulate(clip, TIMES), expected)
        assert len(expected) != 0


def test_vid2e_is_esim_on_frames_along_the_flow(clip):
    found = Vid2E(log_offset=1e-3).simulate(clip, TIMES)
    assert same(found, ESIM(interpolation=FlowInterpolation()).simulate(clip, TIMES))
    # From 24 to 30 the bar passes column 27, which brightens and darkens again on the way; to a
    # pixel that goes straight from one frame to the other nothing happens there.
    plain = ESIM().simulate(clip, TIMES)
    assert not ((plain.x == 27) & (plain.t > 40_000)).any()
    passing = (found.x == 27) & (found.t > 40_000)
    times, signs = found.t[passing], found.p[passing]
    assert set(signs) == {0, 1}
    assert times[signs == 1].max() < times[signs == 0].min()


def test_a_short_interval_has_no_room_for_all_frames(clip):
    events = ESIM(interpolation=LinearInterpolation(factor=10)).simulate(clip, [0, 3, 5])
    assert events.t.min() >= 0
    assert events.t.max() <= 5


def test_parameters_name_the_interpolation_where_there_is_one():
    assert "interpolation" not in ESIM().parameters()
    assert Vid2E().parameters()["interpolation"]["kind"] == "flow"
    fast = Vid2E(interpolation=FlowInterpolation(largest_step_px=2.0)).parameters()
    assert fast["interpolation"]["largest_step_px"] == 2.0


def test_the_published_program_is_not_claimed():
    with pytest.raises(ValueError, match="weights of its network"):
        Vid2E(mode="faithful")
