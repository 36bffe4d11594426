"""Event keys: packing, sorting, and holding back."""

import numpy as np
import pytest

from eqs.simulators.streaming.keys import (
    MAX_PIXELS,
    MAX_TIME_US,
    ReorderBuffer,
    event_key,
    events_of,
    ordered,
    with_room,
)


def keys_of(times, pixels, polarities):
    return np.array(
        [
            event_key(int(t), int(x), int(p))
            for t, x, p in zip(times, pixels, polarities, strict=True)
        ],
        dtype=np.int64,
    )


def test_keys_survive_the_extremes():
    width = 8192
    keys = keys_of([0, MAX_TIME_US - 1], [0, MAX_PIXELS - 1], [0, 1])
    events = events_of([keys], MAX_PIXELS // width, width, origin_us=5)
    assert events.t.tolist() == [5, MAX_TIME_US + 4]
    assert (events.y[1], events.x[1]) == (MAX_PIXELS // width - 1, width - 1)


# How many of 3000 events were written row by row before another run of rows begins.
@pytest.mark.parametrize("runs", [(3000,), (2500,), (1, 2000), (), (500, 1000, 1500)])
@pytest.mark.parametrize("span", [1, 200, 50_000, 20_000_000, MAX_TIME_US - 1000])
def test_sorting_is_by_time_and_pixel_and_keeps_the_order_of_equals(runs, span):
    generator = np.random.default_rng(0)
    times, pixels = generator.integers(1000, 1000 + span, 3000), generator.integers(0, 300, 3000)
    if runs:
        pixels = np.concatenate([np.sort(part) for part in np.split(pixels, runs)])
    polarities = generator.integers(0, 2, 3000)
    found = ordered(keys_of(times, pixels, polarities), 1000)
    order = np.lexsort((np.arange(3000), pixels, times))
    np.testing.assert_array_equal(found, keys_of(times, pixels, polarities)[order])


def test_sorting_nothing_gives_nothing():
    assert len(ordered(np.empty(0, np.int64), 0)) == 0


def test_the_buffer_releases_before_the_watermark_and_merges_the_rest():
    buffer = ReorderBuffer()
    first = buffer.push(keys_of([1, 5, 10, 10], [4, 0, 3, 9], [1, 1, 1, 1]), 10)
    second = buffer.push(keys_of([10, 10, 12, 20], [3, 4, 0, 0], [0, 1, 0, 1]), 20)
    rest = buffer.flush()
    np.testing.assert_array_equal(first, keys_of([1, 5], [4, 0], [1, 1]))
    merged = keys_of([10, 10, 10, 10, 12], [3, 3, 4, 9, 0], [1, 0, 1, 1, 0])
    np.testing.assert_array_equal(second, merged)
    np.testing.assert_array_equal(rest, keys_of([20], [0], [1]))
    assert len(buffer.flush()) == 0


def test_room_grows_and_keeps_what_is_there():
    keys = np.arange(4)
    assert with_room(keys, 4) is not None
    larger = with_room(keys, 100)
    assert larger.size >= 100
    np.testing.assert_array_equal(larger[:4], keys)
