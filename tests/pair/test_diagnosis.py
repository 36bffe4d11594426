"""What a diagnosis says of streams whose difference is known."""

from __future__ import annotations

import numpy as np
import pytest

from eqs.events import Events
from eqs.metrics import corruptions as damage
from eqs.pair import diagnose
from eqs.pair.diagnosis import frame_beat, hot_pixels


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
    assert line.sentence == "It fires 0.25 times as often as the real sensor."
    more = found(stream(20_000), stream(5_000))["event rate"]
    assert more.sentence == "It fires 4.0 times as often as the real sensor."


def test_the_same_stream_differs_in_nothing() -> None:
    lines = found(stream(), stream())
    assert all(line.simulated == pytest.approx(line.real, nan_ok=True) for line in lines.values())
    assert "about as often" in lines["event rate"].sentence


def test_a_strobe_is_heard_and_named() -> None:
    strobe = damage.frame_locked(stream(), np.arange(0, 1_000_001, 50_000))
    assert frame_beat(strobe, 0, 1_000_000) == pytest.approx(20.0, abs=1.1)
    assert frame_beat(stream(), 0, 1_000_000) == 0.0
    beat = "beat, as of frames or lamps"
    said = found(strobe, stream())[beat].sentence
    assert "come 20 times a second together, as with frames" in said
    assert "as under lamps" in found(stream(), strobe)[beat].sentence
    assert "keep the same beat" in found(strobe, strobe)[beat].sentence


def lit(rate_hz: float, depth: float, stop_us: int = 1_000_000) -> Events:
    """Events whose rate follows a wave of so many hertz, `depth` of its mean high."""
    rng = np.random.default_rng(3)
    t = rng.integers(0, stop_us, 40_000)
    wave = 1 + depth * np.sin(2e-6 * np.pi * rate_hz * t)
    t = np.sort(t[rng.random(len(t)) * (1 + depth) < wave])
    zero = np.zeros(len(t), np.int64)
    return Events.from_arrays(t=t, x=zero, y=zero, p=zero, height=32, width=32)


@pytest.mark.parametrize(
    ("rate_hz", "depth", "heard"), [(120, 0.4, 120), (100, 0.04, 0), (2, 1, 0)]
)
def test_lamps_are_heard_and_slow_motion_and_chance_are_not(
    rate_hz: float, depth: float, heard: float
) -> None:
    assert frame_beat(lit(rate_hz, depth), 0, 1_000_000) == pytest.approx(heard, abs=1.1)


def test_events_where_nothing_should_be_are_counted() -> None:
    real = stream()
    noisy = damage.with_noise(real, 1.0)
    line = found(noisy, real)["share of events where the real stream is silent"]
    assert line.simulated == pytest.approx(0.25, abs=0.01)  # half of one half
    assert line.real == 0
    assert "25 % of its events" in line.sentence


def test_polarity_is_put_into_words() -> None:
    line = found(stream(on=0.7), stream(on=0.5))["share of ON events"]
    assert "More of its events are brighter and fewer darker" in line.sentence


def test_pixels_that_fire_by_themselves_are_hot_and_edges_are_not() -> None:
    counts = np.ones((32, 32), np.int64)
    counts[:, 7] = 500  # what moves to and fro along a column
    counts[20, 20] = 500
    hot = hot_pixels(counts.ravel(), 32, 1.0).reshape(32, 32)
    assert hot.sum() == 1
    assert hot[20, 20]
    assert not hot_pixels(counts.ravel(), 32, 100.0).any()  # five times a second is not hot
    line = found(damage.with_hot_pixels(stream(), 0.005), stream())["share of hot pixels"]
    assert (line.simulated, line.real) == (pytest.approx(5 / 1024), 0.0)
    assert "More of its pixels fire by themselves" in line.sentence


def test_the_same_pixels_are_busy_or_others() -> None:
    name = "rank correlation of the pixels' rates with the real ones"
    assert found(damage.thinned(stream(), 0.1), stream())[name].simulated > 0.9
    assert "same pixels" in found(stream(), stream())[name].sentence
    assert "Others" in found(damage.shifted_in_space(stream(), rows=16), stream())[name].sentence


def test_noise_is_missing_where_the_real_sensor_is_quietest() -> None:
    name = "rate of the quietest real pixels, a quarter or more"
    real = damage.with_noise(stream(), 0.1)
    assert "it lacks noise" in found(Events.empty(32, 32), real)[name].sentence
    assert found(real, real)[name].simulated == found(real, real)[name].real > 0


def test_nothing_at_all_is_no_error() -> None:
    empty = Events.empty(32, 32)
    for pair in ((empty, stream()), (stream(), empty), (empty, empty)):
        assert all(line.sentence for line in found(*pair).values())
