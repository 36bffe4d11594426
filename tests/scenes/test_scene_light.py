"""Simulators fed with the renderer's light: the same scene as the frames', without the camera."""

from dataclasses import replace

import numpy as np
import pytest

from eqs.data import Recording, SimulatedEvents
from eqs.frames import Light, LightOfScenes
from eqs.scenes import DSECMini, SceneLight
from eqs.scenes.camera import tone_curve
from eqs.scenes.scene_light import HEADROOM, plan_of
from eqs.simulators import ESIM


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    root = tmp_path_factory.mktemp("data")
    DSECMini(size="64x48", sequences={"test": 1}, frames=4, workers=1).generate(root)
    return Recording.load(root / "test" / "mini_test_000_day")


def renderings(light, recording):
    chunks = list(light.clip(recording.folder, recording.frame_times_us))
    return np.concatenate([c[0] for c in chunks]), np.concatenate([c[1] for c in chunks])


def test_the_light_is_what_the_camera_took_frames_of(recording):
    """Put on the camera's curve it is the frame, but for noise, exposure and saturation."""
    pictures, times = renderings(SceneLight(), recording)
    frames = np.concatenate([images for images, _ in recording.frames()])
    assert (times[0], times[-1]) == (recording.frame_times_us[0], recording.frame_times_us[-1])
    shown = 255 * tone_curve(HEADROOM * pictures[[0, -1]] / 255)
    for picture, frame in zip(shown, frames[[0, -1]], strict=True):
        assert np.abs(picture - frame).mean() < 6
        assert np.corrcoef(picture.ravel(), frame.ravel())[0, 1] > 0.98


def test_it_is_rendered_as_often_as_it_changes(recording):
    times = renderings(SceneLight(), recording)[1]
    finer = renderings(SceneLight(step_log=0.05), recording)[1]
    gaps = np.diff(times)
    assert gaps.min() >= 50 or len(gaps) == 1
    assert gaps.max() <= 10_000
    assert len(finer) > 1.5 * len(times) > 30


def test_instants_of_known_light_lie_a_step_apart():
    light = SceneLight(step_log=0.1, quantile=1.0, longest_us=50_000)

    def brightening(time_us):
        return np.full((2, 2), 0.1 * np.exp(1e-5 * time_us), np.float32)

    seen = list(light.instants(brightening, 0, 100_000))
    logs = np.log(np.array([picture[0, 0] for _, picture in seen]) + 0.01)
    assert np.diff(logs)[:-1] == pytest.approx(0.1, rel=0.06)
    still = list(light.instants(lambda _: np.ones((2, 2), np.float32), 0, 120_000))
    assert [time for time, _ in still] == [0, 50_000, 100_000, 120_000]


def test_a_simulator_fires_more_like_the_sensor_from_it(recording, tmp_path):
    """More events than from frames: nothing is lost to eight bits, exposure and twenty hertz."""
    from eqs.events import Events

    counts = {}
    for name, light in (("frames", None), ("linear", Light()), ("rendered", SceneLight())):
        source = SimulatedEvents(ESIM(light=light), tmp_path, workers=1)
        source.simulate(recording)
        counts[name] = len(Events.load(source.path(recording)))
        assert bool(source.caveat) == (name == "rendered")
        assert source.setting == {"frames": "display", "linear": "srgb"}.get(name, "rendered")
    assert counts["rendered"] > counts["linear"] > counts["frames"]


def test_what_was_not_rendered_here_is_refused(recording, tmp_path):
    assert isinstance(SceneLight(), LightOfScenes)
    assert not isinstance(Light(), LightOfScenes)
    with pytest.raises(ValueError, match=r"rendered by version .*no record of a rendering; set d"):
        plan_of(tmp_path)
    with pytest.raises(ValueError, match=r"Expected a rendered recording for light=rendered"):
        ESIM(light=SceneLight()).simulate(np.zeros((2, 4, 4), np.uint8), [0, 1])
    with pytest.raises(ValueError, match=r"Expected step_log in its range, got 0; set light\.step"):
        SceneLight(step_log=0)
    plan = plan_of(recording.folder)
    assert plan.name == recording.name
    assert replace(plan, frames=5) != plan
