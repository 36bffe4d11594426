"""EventGAN as a simulator: which network simulates what, and what it is refused."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tiny_networks import leave_networks, tiny_learning
from tiny_school import Teacher

from eqs.frames import Lens, Light, LinearInterpolation
from eqs.simulators import EventGAN, Learning

TIMES = 50_000 * np.arange(5)
FRAMES = np.random.default_rng(0).integers(0, 256, (5, 24, 40), np.uint8)


@pytest.fixture
def model():
    return EventGAN(network=tiny_learning())


def simulated(model, sequence="c"):
    events = model.simulate(FRAMES, TIMES, sequence=sequence)
    return events.t.tolist(), events.x.tolist(), events.y.tolist(), events.p.tolist()


def test_a_recording_is_simulated_by_the_network_that_did_not_learn_from_it(model):
    """Of what neither learned from, the first one does."""
    assert [model.fold_of(name) for name in ("a", "b", "c")] == [1, 0, 0]
    for name in ("a", "b", "c"):
        own = replace(model, fold=str(model.fold_of(name)))
        assert simulated(model, name) == simulated(own, name)
    assert simulated(replace(model, fold="0")) != simulated(replace(model, fold="1"))


def test_it_expects_what_its_bias_says_and_fires_that(model):
    """Random weights give about the mean of street scenes, which they start near."""
    events = model.simulate(FRAMES, TIMES)
    assert 0.5 < len(events) / (FRAMES[0].size * 4 * 20 * 0.05) < 2


def test_the_events_do_not_depend_on_the_threads(model):
    before = torch.get_num_threads()
    try:
        found = []
        for threads in (1, 2):
            torch.set_num_threads(threads)
            found.append(simulated(model))
            assert torch.get_num_threads() == threads
    finally:
        torch.set_num_threads(before)
    assert found[0] == found[1]


def test_a_part_of_the_image_sees_what_the_whole_does(model):
    """No norm couples distant pixels, so networks serve sensors of every size."""
    wide = np.random.default_rng(1).integers(0, 256, (2, 160, 320), np.uint8)
    seen = replace(model, seed=3)
    whole = seen.expected(*wide.astype(np.float32), "c", _interval())
    changed = wide.copy()
    changed[:, :, 300:] = 0
    other = seen.expected(*changed.astype(np.float32), "c", _interval())
    np.testing.assert_array_equal(whole[..., :100], other[..., :100])
    assert (whole[..., 290:] != other[..., 290:]).any()


def _interval():
    from eqs.simulators import Interval

    return Interval(1, 0, 50_000)


@pytest.mark.parametrize(
    ("part", "value"),
    [("light", Light()), ("interpolation", LinearInterpolation()), ("lens", Lens())],
)
def test_what_it_did_not_learn_is_refused(model, part, value):
    with pytest.raises(ValueError, match=f"^Expected no {part} for eventgan.*; set {part}=none"):
        replace(model, **{part: value})


def test_other_intervals_than_it_learned_are_refused(model):
    with pytest.raises(ValueError, match="25000 to 100000 us apart"):
        model.simulate(FRAMES, TIMES // 10)


def test_without_networks_the_command_that_makes_them_is_named(tmp_path):
    model = EventGAN(network=Learning(teacher=Teacher(), root=tmp_path))
    with pytest.raises(FileNotFoundError, match="type eqs train-simulator sim=eventgan first"):
        model.parameters()
    with pytest.raises(FileNotFoundError, match="train-simulator"):
        model.simulate(FRAMES, TIMES)


def test_other_weights_are_another_stream(tmp_path):
    """The same recipe learned twice differs by its weights' content alone."""
    learnings = [
        leave_networks(Learning(teacher=Teacher(), root=tmp_path / root, width=8), seed=seed)
        for root, seed in (("a", 0), ("b", 0), ("c", 5))
    ]
    labels = [EventGAN(network=learning).parameters() for learning in learnings]
    assert labels[0] == labels[1] != labels[2]
    assert learnings[0].folder.name == learnings[2].folder.name


def test_another_recipe_or_teacher_learns_in_a_folder_of_its_own(tmp_path):
    learning = Learning(teacher=Teacher(), root=tmp_path)
    others = [
        replace(learning, epochs=3),
        replace(learning, seed=1),
        replace(learning, teacher=Teacher(sensor_hash="4567")),
        replace(learning, teacher=Teacher(name="dsec")),
    ]
    assert len({each.folder for each in (learning, *others)}) == 5
    assert replace(learning, root=tmp_path / "x").folder.name == learning.folder.name


def test_it_is_marked_where_its_teacher_judges(model):
    assert model.caveat("school")
    assert not model.caveat("dsec_mini")
