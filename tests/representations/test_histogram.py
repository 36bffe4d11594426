"""The stacked histogram against a plain reference, the published program and its own laws."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eqs.events import Events
from eqs.representations import stacked_histogram

GOLDEN = Path(__file__).parents[1] / "golden" / "rvt" / "representations.npz"


def plain_histogram(events, bins, start, stop, cutoff):
    """The definition, one event at a time in Python's whole numbers."""
    counts = np.zeros((2 * bins, events.height, events.width), np.int64)
    for t, x, y, p in zip(*(getattr(events, name).tolist() for name in "txyp"), strict=True):
        if start <= t < stop:
            counts[p * bins + (t - start) * bins // (stop - start), y, x] += 1
    return np.minimum(counts, cutoff)


@settings(max_examples=80, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    count=st.integers(0, 300),
    bins=st.integers(1, 23),
    start=st.integers(-500, 1500),
    length=st.integers(1, 2500),
    cutoff=st.integers(1, 12),
)
def test_equals_the_definition(seed, count, bins, start, length, cutoff):
    generator = np.random.default_rng(seed)
    events = Events.from_arrays(
        t=np.sort(generator.integers(0, 2000, count)),
        x=generator.integers(0, 3, count),
        y=generator.integers(0, 2, count),
        p=generator.integers(0, 2, count),
        height=2,
        width=3,
    )
    result = stacked_histogram(events, bins, start, start + length, count_cutoff=cutoff)
    assert result.dtype == np.uint8
    expected = plain_histogram(events, bins, start, start + length, cutoff)
    np.testing.assert_array_equal(result, expected)


def golden_cases():
    stored = np.load(GOLDEN)
    for key in stored.files:
        if "_hist_" in key:
            name, _, cut, fast = key.split("_")
            cutoff = None if cut == "cutNone" else int(cut.removeprefix("cut"))
            yield pytest.param(name, cutoff, fast == "fast1", id=key)


@pytest.mark.parametrize(("name", "cutoff", "wrap"), list(golden_cases()))
def test_span_of_events_equals_the_published_program(name, cutoff, wrap):
    stored = np.load(GOLDEN)
    size = json.loads(str(stored["meta"]))
    fields = {field: stored[f"{name}_{field}"] for field in "txyp"}
    events = Events.from_arrays(**fields, height=size["H"], width=size["W"])
    result = stacked_histogram(events, size["bins"], count_cutoff=cutoff, span="events", wrap=wrap)
    label = "None" if cutoff is None else cutoff
    np.testing.assert_array_equal(result, stored[f"{name}_hist_cut{label}_fast{int(wrap)}"])


def test_counts_are_conserved_without_cutoff(make_events):
    events = make_events(3000, stop_us=50_000)
    result = stacked_histogram(events, start_us=0, stop_us=50_000, count_cutoff=None)
    assert result.sum() == 3000
    assert result[10:].sum() == events.p.sum()


def test_saturates_instead_of_wrapping():
    events = Events.from_arrays([0] * 300, [0] * 300, [0] * 300, [1] * 300, height=1, width=1)
    assert stacked_histogram(events, 1, 0, 9, count_cutoff=None)[1, 0, 0] == 255
    assert stacked_histogram(events, 1, 0, 9, count_cutoff=None, wrap=True)[1, 0, 0] == 300 % 256
    assert stacked_histogram(events, 1, 0, 9, count_cutoff=10)[1, 0, 0] == 10


def test_window_span_keeps_silence_visible(make_events):
    early = make_events(500, stop_us=5_000)
    assert stacked_histogram(early, 10, 0, 50_000)[[*range(1, 10), *range(11, 20)]].sum() == 0
    assert stacked_histogram(early, 10, 0, 50_000, span="events")[9].sum() > 0


def test_open_window_spans_the_stream(make_events):
    events = make_events(500, start_us=40, stop_us=5_000)
    first, last = int(events.t[0]), int(events.t[-1])
    expected = stacked_histogram(events, 10, first, last + 1)
    np.testing.assert_array_equal(stacked_histogram(events), expected)


def test_empty_stream_gives_zeros():
    for span in ("window", "events"):
        assert stacked_histogram(Events.empty(3, 4), 5, 0, 10, span=span).shape == (10, 3, 4)
    assert stacked_histogram(Events.empty(3, 4)).sum() == 0


def test_bad_arguments(make_events):
    events = make_events(10)
    with pytest.raises(ValueError, match="bins and count_cutoff of at least 1, got 0"):
        stacked_histogram(events, bins=0)
    with pytest.raises(ValueError, match="of at least 1, got 10 and 0"):
        stacked_histogram(events, count_cutoff=0)
    with pytest.raises(ValueError, match=r"ends after it starts, got \[5, 5\)"):
        stacked_histogram(events, start_us=5, stop_us=5)
    with pytest.raises(ValueError, match="'window' or 'events', got 'all'"):
        stacked_histogram(events, span="all")
