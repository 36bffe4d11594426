import numpy as np
import pytest

from eqs.scenes import FrameCamera
from eqs.scenes.camera import tone_curve


def flat(lux, shape=(20, 30)):
    return np.full(shape, lux, np.float32)


def test_bright_scenes_get_short_exposures_and_dark_ones_the_longest():
    camera = FrameCamera()
    times = [camera.meter(flat(lux)).time_us for lux in (5000.0, 300.0, 50.0, 0.3)]
    assert times == sorted(times)
    assert times[0] == camera.shortest_us
    assert times[-1] == camera.longest_us
    assert all(time % 2 == 0 for time in times)


def test_the_metered_light_has_the_same_grey_at_any_level():
    camera = FrameCamera()
    greys = []
    for lux in (0.2, 20.0, 2000.0):
        exposure = camera.meter(flat(lux))
        frame = camera.expose(lambda _, lux=lux: flat(lux), 50_000, exposure, (1,))
        greys.append(frame.mean())
    assert np.ptp(greys) < 6.0
    assert 180 < np.mean(greys) < 205


def test_frames_average_the_light_over_the_exposure():
    camera = FrameCamera(read_noise_electrons=0.0, full_well=1e9)
    seen = []

    def radiance(t):
        seen.append(t)
        return flat(1.0 + (t - 100_000.0) / 15_000.0)

    exposure = camera.meter(flat(1.0))
    frame = camera.expose(radiance, 100_000, exposure, (1,))
    assert min(seen) >= 100_000 - 7_500
    assert max(seen) <= 100_000 + 7_500
    assert np.mean(seen) == pytest.approx(100_000.0)
    assert frame.mean() == pytest.approx(255.0 * tone_curve(np.array(0.55)), abs=1.0)


def test_dark_frames_are_noisier():
    camera = FrameCamera()
    noise = []
    for lux in (100.0, 0.3):
        exposure = camera.meter(flat(lux))
        noise.append(camera.expose(lambda _, lux=lux: flat(lux), 0, exposure, (1,)).std())
    assert noise[1] > 3.0 * noise[0] > 0.0


def test_noise_follows_its_key():
    camera = FrameCamera()
    exposure = camera.meter(flat(1.0))
    one, same, other = (
        camera.expose(lambda _: flat(1.0), 0, exposure, (key,)) for key in (1, 1, 2)
    )
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)


def test_tone_curve_is_monotonic_and_ends_at_one():
    values = tone_curve(np.linspace(-0.5, 1.5, 400))
    assert (np.diff(values) >= 0).all()
    assert values[0] == 0.0
    assert values[-1] == pytest.approx(1.0)
