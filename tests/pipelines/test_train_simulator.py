"""Learning EventGAN's networks: once, by halves, resumed to the same digits."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tiny_school import Teacher

from eqs.data import DSECFolder
from eqs.events import EventReader
from eqs.frames import luma
from eqs.pipelines.train_simulator import Fold, ensure_learned, learn, learn_fold
from eqs.scenes import DSECMini
from eqs.simulators import ESIM, EventGAN, Learning
from eqs.training.frame_pairs import BatchNumbers, FramePairs, simplest
from eqs.training.volume_task import VolumeTask, negative_log_likelihood


@pytest.fixture(scope="module")
def school(tmp_path_factory):
    """Three short recordings to learn from, one to look at."""
    return DSECFolder(
        name="school",
        root=tmp_path_factory.mktemp("school") / "school",
        size="48x32",
        splits={"train": ["mini_train_*"], "val": ["mini_val_*"]},
        generator=DSECMini(size="48x32", sequences={"train": 3, "val": 1}, frames=4, workers=1),
    )


@pytest.fixture
def learning(school, tmp_path):
    return Learning(
        teacher=school, root=tmp_path, width=8, epochs=3, steps_per_epoch=3, batch_size=2,
        adversarial_after_epochs=1,
    )  # fmt: skip


@pytest.fixture(autouse=True)
def _threads():
    before = torch.get_num_threads()
    yield
    torch.set_num_threads(before)


def weights(learning, fold):
    return torch.load(learning.weights(fold), weights_only=True)


def test_it_learns_once_and_simulates_each_recording_by_the_network_of_the_others(learning):
    model = EventGAN(network=learning)
    ensure_learned(model)
    record = learning.record()
    names = [[each.name for each in Fold(learning, k).recordings(learning.teacher)] for k in (0, 1)]
    assert record["folds"] == names
    assert [len(each) for each in names] == [2, 1]
    assert {model.fold_of(name) for name in names[0]} == {1}
    assert {model.fold_of(name) for name in names[1]} == {0}
    assert set(record["val"][0]) == {
        "nll", "events_per_real_event", "cosine", "nll_constant", "nll_per_pixel"
    }  # fmt: skip
    times = [learning.weights(fold).stat().st_mtime_ns for fold in (0, 1)]
    ensure_learned(model)
    assert [learning.weights(fold).stat().st_mtime_ns for fold in (0, 1)] == times
    recording = learning.teacher.recordings("val")[0]
    frames = np.concatenate([images for images, _ in recording.frames()])
    events = model.simulate(frames, recording.frame_times_us, recording.name)
    assert len(events) > 0


def test_those_that_do_not_learn_need_nothing():
    ensure_learned(ESIM())


def test_an_interrupted_learning_goes_on_to_the_same_digits(learning, tmp_path, monkeypatch):
    whole = learn_fold(Fold(learning, 0))
    other = replace(learning, root=tmp_path / "other")
    begin = VolumeTask.on_train_epoch_start

    def stop(self):
        if self.current_epoch == 2:
            raise KeyboardInterrupt
        begin(self)

    monkeypatch.setattr(VolumeTask, "on_train_epoch_start", stop)
    with pytest.raises((KeyboardInterrupt, SystemExit)):
        learn_fold(Fold(other, 0))
    assert not other.weights(0).exists()
    monkeypatch.setattr(VolumeTask, "on_train_epoch_start", begin)
    assert learn_fold(Fold(other, 0)) == whole
    assert whole[0] == 0
    first, second = weights(learning, 0), weights(other, 0)
    assert all(torch.equal(first[name], second[name]) for name in first)


def test_networks_of_other_recordings_are_learned_anew(learning, tmp_path):
    learn(learning)
    before = learning.record()
    learning.finish({**before, "data": "of other recordings"})
    learn(learning)
    assert learning.record() == before


def test_what_is_no_data_set_cannot_be_learned_from(learning):
    with pytest.raises(ValueError, match="Expected a data set to learn events from, got none"):
        EventGAN(network=replace(learning, teacher=None))
    with pytest.raises(ValueError, match=r"got a Teacher; set sim\.network\.teacher"):
        ensure_learned(EventGAN(network=replace(learning, teacher=Teacher())))


def test_pairs_hold_what_was_fired_between_their_frames(school):
    school.prepare()
    (recording,) = school.recordings("val")
    pairs = FramePairs([recording], augmented=False)
    assert len(pairs) == 3
    first, second, counts = pairs[1]
    frames = np.concatenate([images for images, _ in recording.frames()])
    grey = luma(frames) if frames.ndim == 4 else frames
    np.testing.assert_array_equal(first.numpy(), grey[1])
    np.testing.assert_array_equal(second.numpy(), grey[2])
    start, stop = (int(t) for t in recording.frame_times_us[1:3])
    events = EventReader(recording.events_path, recording.height, recording.width)
    window = events.window(start, stop)
    assert counts.sum() == len(window)
    on_late = window.p.astype(bool) & (window.t >= start + (stop - start) * 9 // 10)
    assert counts[19].sum() == on_late.sum()


def test_the_simplest_guesses_are_measured_as_a_network_is(school):
    """On what it was made of, the guess for each pixel and polarity is the better one."""
    school.prepare()
    pairs = FramePairs(school.recordings("val"), augmented=False)
    found = simplest(pairs, pairs)
    counts = torch.stack([pair[2] for pair in pairs])
    constant = negative_log_likelihood(counts.mean().expand_as(counts), counts).item()
    assert found["nll_constant"] == pytest.approx(constant, rel=1e-4)
    assert found["nll_per_pixel"] < found["nll_constant"]


def test_a_pair_in_disguise_keeps_its_contrast_and_its_events(school):
    school.prepare()
    recordings = school.recordings("train")[:1]
    plain, disguised = (FramePairs(recordings, augmented=each) for each in (False, True))
    first, _, counts = plain[0]
    mirrored = set()
    for draw in range(12):
        other, _, events = disguised[0, draw]
        assert events.sum() == counts.sum()
        mirrored.add(torch.equal(events, counts.flip(-1)))
        again = disguised[0, draw]
        assert torch.equal(again[0], other)
        ranks = torch.corrcoef(torch.stack([first.flatten(), other.flatten()]))[0, 1]
        flipped = torch.corrcoef(torch.stack([first.flip(-1).flatten(), other.flatten()]))[0, 1]
        assert max(ranks, flipped) > 0.98
    assert mirrored == {True, False}


def test_batches_follow_from_seed_and_epoch_alone():
    numbers = BatchNumbers(pairs=50, batches=4, size=3, seed=1)
    first = list(numbers)
    numbers.set_epoch(1)
    second = list(numbers)
    numbers.set_epoch(0)
    assert list(numbers) == first != second
    draws = [draw for batch in (*first, *second) for _, draw in batch]
    assert draws == list(range(24))
