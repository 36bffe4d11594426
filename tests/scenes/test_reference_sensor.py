import math
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from omegaconf import OmegaConf

from eqs.events import Events
from eqs.scenes import ReferenceSensor

# Changing this number means changing the definition of "real" for every result of the project.
# Nobody may do that to make a result look better.
FROZEN_HASH = "51f1ba55d567"

QUIET = ReferenceSensor(
    threshold_mismatch_log=0.0,
    shot_noise_factor=0.0,
    leak_hz=0.0,
    leak_hz_per_klux=0.0,
    hot_pixel_fraction=0.0,
    refractory_us=0.0,
    latency_us=0.0,
    jitter_us=0.0,
    row_service_us=0.0,
)
CONFIG = Path(__file__).parents[2] / "eqs/configs/sensor/reference_sensor.yaml"


def record(sensor, pictures, *, groups=None, start_us=0, key=(1,)):
    stream = sensor.start(*pictures.shape[1:], noise_key=key, start_us=start_us)
    parts = [stream.step(part) for part in np.split(pictures, groups or [])]
    return Events.concatenate([*parts, stream.finish()])


def ramp(first_lux, last_lux, steps, shape=(8, 8)):
    levels = np.geomspace(first_lux, last_lux, steps).astype(np.float32)
    return np.broadcast_to(levels[:, None, None], (steps, *shape))


def scene(steps=120, shape=(12, 16)):
    phase = np.arange(shape[1]) * 0.6 + np.zeros(shape)
    t = np.arange(steps)[:, None, None]
    return (40.0 * np.exp(np.sin(phase - 0.15 * t))).astype(np.float32)


def test_the_definition_is_frozen():
    assert ReferenceSensor().definition_hash() == FROZEN_HASH


def test_configuration_holds_the_frozen_definition():
    config = OmegaConf.to_container(OmegaConf.load(CONFIG))
    assert config.pop("_target_") == "eqs.scenes.ReferenceSensor"
    assert config == asdict(ReferenceSensor())


def test_hash_changes_with_every_parameter():
    base = ReferenceSensor()
    hashes = {
        replace(base, **{name: type(value)(value + 1)}).definition_hash()
        for name, value in asdict(base).items()
    }
    assert len(hashes) == len(asdict(base))


def test_brighter_light_gives_on_events_and_darker_light_off_events():
    up = record(ReferenceSensor(), ramp(50.0, 200.0, 40))
    down = record(ReferenceSensor(), ramp(200.0, 50.0, 40))
    assert up.p.all()
    assert not down.p.any()
    assert len(up) > 100
    assert len(down) > 100


def test_a_slow_ramp_gives_one_event_per_threshold():
    # A bright photoreceptor follows within a step, so the count is the contrast over threshold.
    contrast = math.log(10_000.0 / 1000.0)
    events = record(QUIET, ramp(1000.0, 10_000.0, 401))
    per_pixel = len(events) / 64
    assert per_pixel == pytest.approx(contrast / QUIET.threshold_on_log, abs=1.0)


def test_refractory_time_separates_the_events_of_a_pixel():
    sensor = replace(QUIET, refractory_us=700.0)
    events = record(sensor, ramp(10.0, 100_000.0, 30, shape=(2, 2)))
    for x in (0, 1):
        for y in (0, 1):
            t = events.t[(events.x == x) & (events.y == y)]
            assert len(t) > 10
            assert np.diff(t).min() >= 699


def test_what_changes_during_reset_is_forgotten():
    ideal = record(QUIET, ramp(1000.0, 10_000.0, 41))
    resting = record(replace(QUIET, refractory_us=900.0), ramp(1000.0, 10_000.0, 41))
    assert len(resting) < 0.9 * len(ideal)


def test_dim_pixels_answer_later_than_bright_ones():
    def delay(lux):
        step = np.full((400, 4, 4), lux, np.float32)
        step[20:] *= 2.0
        return float(np.median(record(QUIET, step).t)) - 20_000

    assert delay(100.0) < 1_000 < delay(0.05) < 60_000


def test_photoreceptor_settles_on_the_logarithm_of_the_current():
    stream = QUIET.start(2, 2, noise_key=(0,))
    stream.step(np.full((1, 2, 2), 1.0, np.float32))
    stream.step(np.full((500, 2, 2), 5.0, np.float32))
    expected = math.log(5.0 * QUIET.photocurrent_fa_per_lux + QUIET.dark_current_fa)
    assert stream._state[0] == pytest.approx(expected, abs=1e-4)


def test_shot_noise_has_the_variance_of_the_linear_system():
    # White noise through the second-order low-pass: variance S omega / (8 zeta) for one-sided S.
    sensor = replace(QUIET, shot_noise_factor=2.0, threshold_on_log=50.0, threshold_off_log=50.0)
    lux = 0.02
    stream = sensor.start(60, 60, noise_key=(3,))
    stream.step(np.full((600, 60, 60), lux, np.float32))
    current = lux * sensor.photocurrent_fa_per_lux + sensor.dark_current_fa
    both = (sensor.photodiode_capacitance_ff + sensor.miller_capacitance_ff) * 0.025 / current
    miller = sensor.miller_capacitance_ff * 0.025 / current
    out = sensor.amplifier_time_us * 1e-6
    omega_squared = (sensor.back_gate * sensor.amplifier_gain + 1.0) / (both * out)
    damping = (both + sensor.amplifier_gain * miller + out) / (both * out)
    density = 2.0 * 2.0 * 1.602e-4 / current  # one-sided, charge in fA s
    expected = density * omega_squared / (4.0 * damping)
    # Backward Euler at 1 ms loses the part of the noise above some hundred Hz.
    assert 0.5 * expected < stream._state[0].var() < 1.05 * expected


def test_bright_static_scene_gives_leak_events_at_the_nominal_rate():
    # Nearly no OFF threshold: the recording then begins in the leak's own steady state.
    sensor = replace(QUIET, leak_hz=0.1, leak_hz_per_klux=0.2, threshold_off_log=1e-3)
    events = record(sensor, np.full((3001, 48, 48), 100.0, np.float32))
    rate = len(events) / (48 * 48 * 3.0)
    assert events.p.all()
    assert rate == pytest.approx(0.1 + 0.2 * 0.1, rel=0.15)


def test_dark_static_scene_is_noisier_than_a_bright_one_in_both_polarities():
    dark = record(ReferenceSensor(), np.full((501, 32, 32), 0.02, np.float32))
    bright = record(ReferenceSensor(), np.full((501, 32, 32), 20.0, np.float32))
    assert len(dark) > 4 * len(bright)
    assert 0.3 < dark.p.mean() < 0.8


def test_hot_pixels_stand_out():
    sensor = replace(ReferenceSensor(), hot_pixel_fraction=0.01)
    events = record(sensor, np.full((501, 40, 40), 100.0, np.float32))
    counts = np.bincount(events.y.astype(int) * 40 + events.x, minlength=1600)
    assert 4 <= (counts >= 4).sum() <= 40


def test_same_events_whatever_the_chunks():
    pictures = scene()
    whole = record(ReferenceSensor(), pictures)
    cut = record(ReferenceSensor(), pictures, groups=[1, 2, 7, 50, 51])
    assert len(whole) > 500
    for name in ("t", "x", "y", "p"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(cut, name))


def test_later_start_shifts_the_same_events():
    pictures, offset = scene(40), 50_000_000_000
    early = record(ReferenceSensor(), pictures)
    late = record(ReferenceSensor(), pictures, start_us=offset)
    np.testing.assert_array_equal(early.t + offset, late.t)
    np.testing.assert_array_equal(early.x, late.x)


def test_noise_differs_between_recordings_but_the_sensor_is_the_same():
    dark = np.full((200, 24, 24), 0.02, np.float32)
    one, other = (record(ReferenceSensor(), dark, key=(k,)) for k in (1, 2))
    assert len(one) != len(other) or not np.array_equal(one.t, other.t)
    first, second = (ReferenceSensor().start(24, 24, noise_key=(k,)) for k in (1, 2))
    np.testing.assert_array_equal(first._thresholds, second._thresholds)
    assert first._thresholds.std() == pytest.approx(0.021, rel=0.15)


def test_readout_lets_a_row_leave_together():
    sensor = replace(QUIET, row_service_us=50.0)
    flash = np.full((6, 3, 40), 1000.0, np.float32)
    flash[3:] *= 1.2
    sensor = replace(sensor, threshold_on_log=0.15, threshold_off_log=0.15)
    events = record(sensor, flash)
    for row in range(3):
        times = events.t[events.y == row]
        assert len(np.unique(times)) <= 20 < len(times)


@pytest.mark.parametrize("name", ["threshold_on_log", "dark_current_fa", "step_us"])
def test_impossible_parameters_are_refused(name):
    with pytest.raises(ValueError, match=name):
        ReferenceSensor(**{name: 0})


def test_negative_parameters_are_refused():
    with pytest.raises(ValueError, match=r"leak_hz >= 0, got -1.*scene\.sensor\.leak_hz"):
        ReferenceSensor(leak_hz=-1.0)


def test_wrong_picture_size_is_refused():
    stream = ReferenceSensor().start(4, 4, noise_key=(0,))
    with pytest.raises(ValueError, match="4x4"):
        stream.step(np.ones((1, 5, 4), np.float32))


def test_light_that_is_not_a_number_is_refused():
    stream = ReferenceSensor().start(2, 2, noise_key=(0,))
    with pytest.raises(ValueError, match="finite light"):
        stream.step(np.full((1, 2, 2), np.nan, np.float32))
