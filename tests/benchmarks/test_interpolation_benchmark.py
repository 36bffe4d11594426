"""The benchmark of interpolations compares with what was rendered, and counts events alike."""

import numpy as np
import pytest

from eqs.benchmarks.interpolation import (
    BIN_US,
    FACTOR,
    PERIOD_US,
    START_US,
    Job,
    cosine,
    measured_in,
    rendered,
)
from eqs.events import Events
from eqs.frames import LinearInterpolation

SIZE = (24, 32)


class Rendered:
    """Makes the frames that were there."""

    def between(self, first, second):
        frames, _ = rendered(0, SIZE, 2)
        (index,) = (k for k in range(0, len(frames), FACTOR) if np.array_equal(frames[k], first))
        return frames[index + 1 : index + FACTOR].astype(np.float32)

    def parameters(self):
        return {}


def test_frames_are_those_of_the_camera_and_nineteen_between():
    frames, times_us = rendered(0, SIZE, 2)
    assert frames.shape == (2 * FACTOR + 1, *SIZE)
    assert frames.dtype == np.uint8
    assert np.unique(np.diff(times_us)).tolist() == [PERIOD_US]
    assert FACTOR * PERIOD_US == 50_000
    assert not np.array_equal(rendered(1, SIZE, 2)[0], frames)


@pytest.mark.filterwarnings("ignore:divide by zero:RuntimeWarning")
def test_the_frames_that_were_there_are_perfect():
    found = measured_in(0, Job(Rendered(), SIZE, worlds=1, pairs=2))
    assert found.psnr_db == np.inf
    assert (found.cosine, found.events) == (pytest.approx(1), 1)


def test_cross_fades_add_no_events():
    none = measured_in(0, Job(None, SIZE, worlds=1, pairs=2))
    linear = measured_in(0, Job(LinearInterpolation(factor=FACTOR), SIZE, worlds=1, pairs=2))
    assert np.isnan(none.psnr_db)
    assert 15 < linear.psnr_db < 45
    assert linear.events == pytest.approx(none.events, rel=0.02)
    assert none.events < 1
    assert max(none.cosine, linear.cosine) < 0.5


def test_counts_agree_where_pixels_polarities_and_times_do():
    def stream(t, x, p):
        return Events.from_arrays(t, x, [0] * len(t), p, height=2, width=3)

    start = START_US
    truth = stream([start, start + 1, start + BIN_US], [0, 1, 2], [1, 1, 0])
    assert cosine(truth, truth) == pytest.approx(1)
    same_bins = stream([start + 2, start + 3, start + BIN_US + 9], [1, 0, 2], [1, 1, 0])
    assert cosine(same_bins, truth) == pytest.approx(1)
    one_elsewhere = stream([start, start + 1, start + BIN_US], [0, 1, 2], [1, 0, 0])
    assert cosine(one_elsewhere, truth) == pytest.approx(2 / 3)
    assert cosine(stream([start], [0], [1]), truth) == pytest.approx(1 / np.sqrt(3))
