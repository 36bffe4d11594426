"""The scanned one-pole sensor against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from eqs.events import Events
from eqs.scenes import FirstOrderSensor

QUIET = FirstOrderSensor(
    threshold_on_log=0.1,
    threshold_off_log=0.1,
    threshold_mismatch_log=0.0,
    noise_log=0.0,
    leak_log_per_s=0.0,
    hot_pixel_fraction=0.0,
    dim_time_us_lux=0.0,
    dark_lux=1e-6,
)


def record(
    sensor: FirstOrderSensor, pictures: np.ndarray, groups: list[int] | None = None
) -> Events:
    stream = sensor.start(*pictures.shape[1:], noise_key=(1,))
    parts = np.split(pictures, np.cumsum(groups or [len(pictures)])[:-1])
    return Events.concatenate([*(stream.step(part) for part in parts), stream.finish()])


def steps(before: float, after: float, n: int, side: int = 8) -> np.ndarray:
    pictures = np.full((n, side, side), after, np.float32)
    pictures[:1] = before
    return pictures


def test_a_ramp_of_the_log_light_fires_once_per_threshold() -> None:
    log_light = np.linspace(0.0, 2.0, 2001)
    events = record(QUIET, np.exp(log_light)[:, None, None] * np.ones((1, 8, 8), np.float32))
    per_pixel = np.bincount(events.y.astype(int) * 8 + events.x, minlength=64)
    assert events.p.all()
    assert set(per_pixel) <= {19, 20}  # two log units less the lag of half a millisecond


def test_the_pole_has_covered_its_share_after_its_time_constant() -> None:
    slow = FirstOrderSensor(**{**vars(QUIET), "bias_time_us": 20_000.0})
    events = record(slow, steps(1.0, np.e, 400))
    # Light rises within the first step, so the pole starts half a step late.
    early = events.t <= 20_000 + 500
    counts = np.bincount((events.y.astype(int) * 8 + events.x)[early], minlength=64)
    assert abs(counts.mean() - (1 - np.exp(-1)) / 0.1) < 0.6


def test_dim_light_is_slower() -> None:
    sensor = FirstOrderSensor(**{**vars(QUIET), "dim_time_us_lux": 10_000.0})
    dim, bright = (record(sensor, steps(low, low * np.e, 200)) for low in (0.1, 100.0))
    assert np.median(dim.t) > 5 * np.median(bright.t)


def test_a_pixel_sends_one_event_per_scan_and_makes_up_for_it_later() -> None:
    events = record(QUIET, steps(1.0, np.exp(3.0), 100))
    pixel = events.y.astype(int) * 8 + events.x
    for index in range(64):
        gaps = np.diff(events.t[pixel == index])
        assert len(gaps) >= 27
        assert (gaps >= 499).all()


def test_rows_are_scanned_one_after_the_other() -> None:
    events = record(QUIET, steps(1.0, np.exp(3.0), 100))
    assert set((events.t % 500).tolist()) == {int(500 * row / 8) for row in range(8)}
    assert (events.t % 500 == (500 * events.y.astype(np.int64)) // 8).all()


def test_noise_is_as_strong_in_the_dark_as_in_the_light() -> None:
    sensor = FirstOrderSensor(
        **{**vars(QUIET), "noise_log": 0.035, "threshold_on_log": 0.1, "dark_lux": 0.05}
    )
    dark, bright = (
        len(record(sensor, np.full((1001, 32, 32), lux, np.float32))) for lux in (0.02, 200.0)
    )
    assert dark > 500
    assert dark == bright  # the same draws cross the same thresholds


def test_memories_leak_either_way() -> None:
    sensor = FirstOrderSensor(**{**vars(QUIET), "leak_log_per_s": 0.5})
    events = record(sensor, np.full((3001, 32, 32), 10.0, np.float32))
    assert 0.4 < events.p.mean() < 0.6
    # A pixel that drifts by d thresholds a second fires d times: mean |d| of a normal number.
    rate = len(events) / 3.0 / 1024
    assert abs(rate - 5.0 * np.sqrt(2 / np.pi)) < 0.35


def test_events_do_not_depend_on_how_pictures_are_grouped() -> None:
    rng = np.random.default_rng(0)
    pictures = rng.uniform(1, 100, (60, 8, 8)).astype(np.float32)
    whole = record(FirstOrderSensor(), pictures)
    cut = record(FirstOrderSensor(), pictures, groups=[1, 2, 7, 50])
    assert len(whole) > 100
    for name in "txyp":
        np.testing.assert_array_equal(getattr(whole, name), getattr(cut, name))


@pytest.mark.parametrize("name", ["dark_lux", "bias_time_us", "threshold_on_log", "scan_us"])
def test_nothing_that_divides_may_be_zero(name: str) -> None:
    with pytest.raises(ValueError, match=name):
        FirstOrderSensor(**{name: 0})


def test_scans_fill_a_step() -> None:
    with pytest.raises(ValueError, match="whole scans"):
        FirstOrderSensor(scan_us=300)
