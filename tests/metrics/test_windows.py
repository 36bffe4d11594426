"""Streams cut into common windows."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from eqs.events import EventReader, Events
from eqs.metrics import Definition, group_chunks, normalised_counts, window_starts
from eqs.metrics.windows import chunk_length, common_grid
from eqs.representations import stacked_histogram


def at(*times):
    zeros = [0] * len(times)
    return Events.from_arrays(t=times, x=zeros, y=zeros, p=zeros, height=4, width=6)


def test_the_reference_sets_the_windows_and_the_remainder_is_dropped():
    starts = window_starts([at(5, 74), at(20, 100)], 10)
    assert starts.tolist() == [5, 15, 25, 35, 45, 55, 65]


def test_a_stated_span_wins_over_events():
    watched = replace(at(30, 40), span_us=(0, 60))
    assert window_starts([watched, at(2, 90)], 20).tolist() == [0, 20, 40]
    assert window_starts([at(5, 74), watched], 20).tolist() == [5, 25]


def test_last_event_belongs_to_the_overlap():
    assert window_starts([at(0, 19)], 10).tolist() == [0, 10]
    assert window_starts([at(0, 18)], 10).tolist() == [0]


def test_silence_at_either_end_of_a_candidate_that_states_its_span_is_compared():
    clip = replace(at(70, 75), span_us=(0, 80))
    assert window_starts([at(0, 39), clip], 20).tolist() == [0, 20]
    assert window_starts([at(60, 79), replace(at(1, 5), span_us=(0, 80))], 20).tolist() == [60]
    assert window_starts([at(0, 39), replace(at(), span_us=(0, 80))], 20).tolist() == [0, 20]


def test_a_grid_knows_its_ends_and_its_share_of_the_reference():
    grid = common_grid([at(0, 99), replace(at(), span_us=(10, 85))], 20)
    assert (grid.start_us, grid.stop_us, grid.count) == (10, 70, 3)
    assert grid.share == pytest.approx(0.6)
    assert common_grid([replace(at(5), span_us=(0, 100)), at(5)], 30).share == pytest.approx(0.9)
    assert common_grid([at(50, 99), at(50, 99)], 20, 0, 100).share == 1.0
    assert common_grid([at(), at(0, 99)], 20).share is None


def test_explicit_limits_win():
    assert window_starts([at(5, 100)], 10, -20, 5).tolist() == [-20, -10]


def test_a_stream_without_events_sets_no_limit():
    assert window_starts([at(), at(0, 29)], 10).tolist() == [0, 10, 20]
    assert window_starts([at(), at()], 10, 0, 10).tolist() == [0]


def test_refusals():
    with pytest.raises(ValueError, match="overlap in time, got a common stretch from 50 us to 11"):
        window_starts([at(0, 10), at(50, 90)], 10)
    with pytest.raises(ValueError, match="one window of 1000 us, got an overlap of 11 us"):
        window_starts([at(0, 10)], 1000)
    with pytest.raises(ValueError, match="got none; give start_us and stop_us"):
        window_starts([at(), at()], 10)


def test_chunks_are_the_windows_histograms(make_events):
    streams = [make_events(1), make_events(2)]
    definition = Definition(bins=2)
    chunks, count = group_chunks(
        streams, definition, start_us=100_000, stop_us=460_000, chunk_windows=3
    )
    chunks = list(chunks)
    assert count == 7
    assert [tuple(chunk.shape) for chunk in chunks] == [
        (3, 2, 4, 20, 28),
        (3, 2, 4, 20, 28),
        (1, 2, 4, 20, 28),
    ]
    expected = stacked_histogram(streams[1], bins=2, start_us=250_000, stop_us=300_000)
    np.testing.assert_array_equal(chunks[1][0, 1].numpy(), expected)
    assert chunks[0].dtype == torch.uint8


def test_histograms_pass_through():
    tensors = [torch.randint(0, 9, (5, 4, 6, 8), dtype=torch.uint8) for _ in range(3)]
    chunks, count = group_chunks(tensors, Definition(bins=2), chunk_windows=2)
    joined = torch.cat(list(chunks))
    assert count == 5
    assert torch.equal(joined, torch.stack(tensors, dim=1))


@pytest.mark.parametrize(
    ("streams", "message"),
    [
        ([torch.zeros(2, 4, 3, 3), torch.zeros(1, 4, 3, 3)], "histograms of one shape"),
        ([torch.zeros(2, 6, 3, 3)], r"shape \(windows, 4, height, width\).*set eqs.bins"),
        ([torch.zeros(0, 4, 3, 3)], "at least one window"),
        ([torch.full((2, 4, 3, 3), torch.nan)], "finite histograms, got NaN"),
        ([torch.zeros(2, 4, 3, 3), at(1, 2)], "got both; convert one of them"),
        ([at(1, 2), Events.empty(9, 9)], "one sensor size, got 6x4 and 9x9"),
    ],
)
def test_streams_that_do_not_fit_are_refused(streams, message):
    with pytest.raises(ValueError, match=message):
        group_chunks(streams, Definition(bins=2))


def test_chunks_shrink_as_frames_grow():
    assert chunk_length(2, 480, 640) == 4
    assert chunk_length(2, 96, 128) == 32
    assert chunk_length(99, 720, 1280) == 1


def test_normalised_windows_have_the_mean_count_of_the_rate():
    definition = Definition(bins=2, window_us=20_000, count_cutoff=255)
    histograms = np.random.default_rng(0).integers(0, 9, (3, 2, 4, 6, 8)).astype(np.float32)
    histograms[1, 0] = 0
    expected = np.zeros_like(histograms)
    for index in np.ndindex(3, 2):
        if index != (1, 0):
            events = histograms[index].sum()
            expected[index] = histograms[index] * (35 * 0.02 * 6 * 8) / events
    found = normalised_counts(torch.from_numpy(histograms), definition)
    np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_normalised_counts_saturate():
    lonely = torch.zeros(4, 480, 640)
    lonely[0, 0, 0] = 1
    found = normalised_counts(lonely, Definition(bins=2))
    assert found.max() == 10
    assert torch.count_nonzero(found) == 1


def test_files_and_memory_give_the_same_chunks(make_events, tmp_path):
    events = make_events(1)
    events.save(tmp_path / "events.h5")
    with EventReader(tmp_path / "events.h5") as reader:
        from_file, count = group_chunks([events, reader], Definition(bins=2))
        for chunk in from_file:
            assert torch.equal(chunk[:, 0], chunk[:, 1])
    assert count == (int(events.t[-1]) + 1 - int(events.t[0])) // 50_000
