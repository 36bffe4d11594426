"""Every chain changes what it says it changes."""

from __future__ import annotations

import numpy as np
import pytest

from eqs.events import Events
from eqs.scenes import PASSING, FirstOrderSensor, ObjectScene, ReferenceSensor
from eqs.simulators.esim import ESIM
from eqs.trial import damage_chains, sensor_chains
from eqs.trial.chains import between, held, toned
from eqs.trial.recorded import RenderedTrial


@pytest.fixture(scope="module")
def pictures() -> np.ndarray:
    scene = ObjectScene(height=24, width=32, seed=(3,), manner=PASSING)
    return np.stack([scene.radiance(t) for t in range(0, 400_001, 1000)])


@pytest.fixture(scope="module")
def made(pictures: np.ndarray) -> dict[tuple[str, int], Events]:
    levels = sensor_chains(ReferenceSensor(), pictures, (1,))
    return {(level.kind, level.step): level.make() for level in levels}


def test_contrast_noise_leak_and_dead_time_change_the_number_of_events(made) -> None:
    count = {key: len(events) for key, events in made.items()}
    plain = count["no leak", 1]
    assert count["contrast lower", 2] > count["contrast lower", 1] > plain
    assert count["contrast higher", 2] < count["contrast higher", 1] < plain
    assert count["more noise", 2] > count["more noise", 1]
    assert count["less noise", 2] <= count["less noise", 1]
    assert count["more leak", 2] > count["more leak", 1] > plain
    assert count["refractory", 2] < plain
    assert made["more ON", 2].p.mean() > 0.5 > made["more OFF", 2].p.mean()


def test_a_camera_is_only_changed_in_what_it_has(pictures: np.ndarray) -> None:
    kinds = {level.kind for level in sensor_chains(FirstOrderSensor(), pictures, (1,))}
    assert "refractory" not in kinds
    assert {"contrast lower", "slower", "less noise", "light held"} <= kinds


def test_light_between_frames_meets_every_frame(pictures: np.ndarray) -> None:
    straight, stairs = between(pictures, 10), held(pictures, 10)
    np.testing.assert_allclose(straight[::10], pictures[::10], rtol=1e-6)
    np.testing.assert_array_equal(stairs[::10], pictures[::10])
    np.testing.assert_array_equal(stairs[9], pictures[0])
    np.testing.assert_allclose(straight[5], (pictures[0] + pictures[10]) / 2, rtol=1e-5)


def test_a_tone_curve_keeps_the_middle_and_lowers_contrast(pictures: np.ndarray) -> None:
    curved = toned(pictures, 2.2)
    assert np.log(curved).std() == pytest.approx(np.log(pictures).std() / 2.2, rel=1e-3)


def test_damages_are_graded(made) -> None:
    events = made["no leak", 1]
    chains: dict[str, list[Events]] = {}
    for level in damage_chains(events, start_us=0, stop_us=400_000):
        chains.setdefault(level.kind, []).append(level.make())
    assert [len(each) for each in chains["dropped"]] == sorted(
        (len(each) for each in chains["dropped"]), reverse=True
    )
    assert len(chains["noise carpet"][3]) > 2.5 * len(events)
    assert set(chains["strobe"][2].t % 50_000) == {0}
    assert (chains["polarity flipped"][2].p != events.p).all()
    assert len(chains) == 8


def test_the_ceiling_is_another_specimen_in_the_same_place() -> None:
    def trial() -> RenderedTrial:
        scenes = [ObjectScene(height=24, width=32, seed=(k,), manner=PASSING) for k in (3, 4)]
        return RenderedTrial(
            scene=scenes[0], other=scenes[1], sensor=ReferenceSensor(), windows=4, key=(7,),
            simulators={"esim": ESIM()},
        )  # fmt: skip

    levels = list(trial().levels())
    streams = {level.kind: level.make() for level in levels if level.kind in ("ceiling", "blank")}
    reference = trial().reference()
    assert len(streams["blank"]) == 0
    assert len(streams["ceiling"]) == pytest.approx(len(reference), rel=0.2)
    assert not np.array_equal(streams["ceiling"].t, reference.t)
    assert levels[-1].kind == "simulator"
    again = trial().reference()
    np.testing.assert_array_equal(again.t, reference.t)
