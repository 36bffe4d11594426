"""What a diagnosis says of streams whose difference is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from eqs.events import Events
from eqs.metrics import corruptions as damage
from eqs.pair import diagnose
from eqs.pair.diagnosis import frame_beat


def stream(count: int = 20_000, seed: int = 0, on: float = 0.5) -> Events:
    rng = np.random.default_rng(seed)
    return Events.from_arrays(
        t=np.sort(rng.integers(0, 1_000_000, count)),
        x=rng.integers(0, 32, count),
        y=rng.integers(0, 16, count),  # the lower half of the sensor is silent
        p=(rng.random(count) < on).astype(int),
        height=32,
        width=32,
    )


def found(simulated: Events, real: Events) -> dict:
    lines = diagnose(simulated, real, start_us=0, stop_us=1_000_000).findings
    return {line.name: line for line in lines}


def test_rates_are_counts_over_pixels_and_seconds() -> None:
    line = found(stream(5_000), stream(20_000))["event rate"]
    assert line.simulated == pytest.approx(5_000 / 1024)
    assert line.real == pytest.approx(20_000 / 1024)
    assert "4.0 times less than" in line.sentence
    more = found(stream(20_000), stream(5_000))["event rate"]
    assert "4.0 times as much as" in more.sentence


def test_the_same_stream_differs_in_nothing() -> None:
    lines = found(stream(), stream())
    assert all(line.simulated == pytest.approx(line.real, nan_ok=True) for line in lines.values())
    assert "about as much" in lines["event rate"].sentence


def test_a_strobe_is_heard_and_named() -> None:
    strobe = damage.frame_locked(stream(), np.arange(0, 1_000_001, 50_000))
    assert frame_beat(strobe, 0, 1_000_000) == pytest.approx(20.0, abs=1.1)
    assert frame_beat(stream(), 0, 1_000_000) == 0.0
    assert "20 Hz, most likely the frames" in found(strobe, stream())["strongest beat"].sentence


def test_events_where_nothing_should_be_are_counted() -> None:
    real = stream()
    noisy = damage.with_noise(real, 1.0)
    line = found(noisy, real)["share of events on pixels silent in the real stream"]
    assert line.simulated == pytest.approx(0.25, abs=0.01)  # half of one half
    assert line.real == 0
    assert "25 % of its events" in line.sentence


def test_polarity_is_put_into_words() -> None:
    line = found(stream(on=0.7), stream(on=0.5))["share of ON events"]
    assert "more brighter and fewer darker" in line.sentence


def test_nothing_at_all_is_no_error() -> None:
    empty = replace(Events.empty(32, 32))
    for pair in ((empty, stream()), (stream(), empty), (empty, empty)):
        assert all(line.sentence for line in found(*pair).values())
