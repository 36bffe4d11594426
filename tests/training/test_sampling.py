"""The schedule is complete, fair and a function of seed, step and slot alone."""

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eqs.training import Schedule, keyed_generator


def schedule(**options):
    settings = {"seed": 3, "window_counts": (7, 5, 12, 1), "batch_size": 4, "sequence_length": 5}
    return Schedule(**{**settings, **options})


@settings(max_examples=40, deadline=None)
@given(
    counts=st.lists(st.integers(1, 23), min_size=1, max_size=6),
    length=st.integers(1, 7),
    slot=st.integers(0, 3),
    seed=st.integers(0, 99),
)
def test_stream_slot_plays_every_window_once_per_pass_in_order(counts, length, slot, seed):
    plan = schedule(seed=seed, window_counts=tuple(counts), sequence_length=length, stream_share=1)
    chunks_per_pass = sum(-(-count // length) for count in counts)
    for number in range(2):
        steps = range(number * chunks_per_pass, (number + 1) * chunks_per_pass)
        chunks = [plan.chunk(step, slot) for step in steps]
        played = [(each.recording, each.start + i) for each in chunks for i in range(each.count)]
        assert sorted(played) == [(r, i) for r, count in enumerate(counts) for i in range(count)]
        for before, after in pairwise(chunks):
            if after.first:
                assert before.start + before.count == counts[before.recording]
            else:
                assert after.recording == before.recording
                assert after.start == before.start + before.count
                assert after.key == before.key
        assert all(each.first == (each.start == 0) for each in chunks)


def test_passes_and_slots_have_orders_of_their_own():
    plan = schedule(window_counts=(5,) * 12, stream_share=1)

    def order(slot, number):
        return [plan.chunk(12 * number + k, slot).recording for k in range(12)]

    assert len({tuple(order(slot, number)) for slot in range(4) for number in range(3)}) == 12


def test_random_windows_are_equally_likely_and_inside():
    plan = schedule(stream_share=0, window_counts=(20, 10, 3), sequence_length=4)
    chunks = [plan.chunk(step, slot) for step in range(1500) for slot in range(4)]
    ends = Counter((each.recording, each.start + each.count - 1) for each in chunks)
    expected = len(chunks) / 33
    assert all(each.first and not each.stream for each in chunks)
    assert all(each.start >= 0 and 1 <= each.count <= 4 for each in chunks)
    # Runs that would begin before a recording are moved to its start and share an end.
    assert all(abs(ends[0, end] - expected) < 6 * expected**0.5 for end in range(4, 20))
    assert ends[0, 3] == pytest.approx(4 * expected, rel=0.2)
    assert {each.count for each in chunks if each.recording == 2} == {3}


def test_random_windows_end_at_labels():
    ends = (np.array([9]), np.array([], np.int64), np.array([4, 7]))
    plan = schedule(stream_share=0, window_counts=(10, 10, 10), ends=ends)
    found = {
        (each.recording, each.start + each.count - 1)
        for each in (plan.chunk(step, 0) for step in range(200))
    }
    assert found == {(0, 9), (2, 4), (2, 7)}


@pytest.mark.parametrize(
    ("share", "size", "stream"),
    [
        (0.5, 8, 4),
        (0.5, 5, 3),
        (0.5, 1, 1),
        (0.25, 4, 1),
        (0.25, 5, 2),
        (0.7, 10, 7),
        (1, 3, 3),
        (0, 3, 0),
    ],
)
def test_kinds_of_slots(share, size, stream):
    plan = schedule(stream_share=share, batch_size=size)
    kinds = [plan.chunk(7, position).stream for position in range(size)]
    assert kinds == [True] * stream + [False] * (size - stream)


def test_depends_on_seed_step_and_slot_only():
    steps = np.random.default_rng(0).permutation(40)
    forwards = [schedule().chunk(step, 1) for step in range(40)]
    for step in steps:
        assert schedule().chunk(int(step), 1) == forwards[step]
    assert [schedule(seed=4).chunk(step, 1) for step in range(40)] != forwards


@pytest.mark.parametrize("share", [0, 0.3, 1])
def test_processes_share_the_slots_that_one_would_have(share):
    whole = schedule(stream_share=share, batch_size=6, window_counts=(5,) * 9)
    ranks = [
        schedule(stream_share=share, batch_size=6, window_counts=(5,) * 9, rank=rank, world_size=2)
        for rank in range(2)
    ]
    for step in range(10):
        parts = [ranks[rank].chunk(step, position) for rank in range(2) for position in range(3)]
        assert parts == [whole.chunk(step, position) for position in range(6)]


def test_keys_do_not_collide():
    draws = {
        keyed_generator(seed, name, slot, step).integers(2**60)
        for seed in range(3)
        for name in ("order", "random")
        for slot in range(4)
        for step in range(4)
    }
    assert len(draws) == 3 * 2 * 4 * 4


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"stream_share": 1.5}, r"share of streams in \[0, 1\], got 1.5; set recipe\.stream"),
        ({"batch_size": 0}, r"set recipe\.batch_size"),
        ({"world_size": 3}, r"set recipe\.batch_size or trainer\.devices"),
        ({"seed": -1}, "a seed of at least 0, got 4, 5 and -1"),
        ({"window_counts": (3, 0)}, "at least one window"),
        ({"window_counts": ()}, "at least one window"),
        ({"ends": (np.array([], np.int64),) * 4}, r"labelled windows .*got none; set protocol"),
    ],
)
def test_bad_arguments(options, message):
    with pytest.raises(ValueError, match=message):
        schedule(**options)
