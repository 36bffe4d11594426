"""Baselines: what each sees, what it is blind to, and its closed forms."""

import math

import numpy as np
import pytest
import torch

from eqs.events import Events
from eqs.metrics import corruptions as damage
from eqs.metrics.baselines import (
    FeatureFrechet,
    baselines,
    interval_distance,
    log_rate_error,
    phase_locking_error,
    point_baselines,
    polarity_error,
    rate_map_correlation,
    tensor_baselines,
)
from eqs.metrics.definition import Definition

FRAMES = np.arange(0, 1_000_001, 50_000)
BEST = {
    "rate_map_correlation": 1.0, "voxel_ssim": 1.0, "raw_cosine": 1.0, "voxel_psnr": math.inf,
    "count_cosine": 1.0,
}  # fmt: skip


@pytest.fixture
def events(make_events):
    return make_events(1, count=20_000)


def scores(simulated, real):
    return baselines(
        simulated, real, Definition(), start_us=0, stop_us=1_000_000, frame_times_us=FRAMES
    )


def stream(t, x=None, p=None, width=8, height=4):
    columns = [0] * len(t)
    return Events.from_arrays(
        t=t, x=x or columns, y=columns, p=p or columns, height=height, width=width
    )


def test_a_stream_is_best_beside_itself(events):
    found = scores(events, events)
    for name, value in found.items():
        assert value == pytest.approx(BEST.get(name, 0.0), abs=1e-6), name
        assert name in BEST or name.endswith(("_error", "_distance"))


def test_thinning_makes_what_counts_worse(events):
    found = scores(damage.thinned(events, 0.5), events)
    assert found["log_rate_error"] == pytest.approx(math.log(2), abs=0.05)
    assert found["interval_distance"] == pytest.approx(math.log10(2), abs=0.1)
    assert found["polarity_error"] < 0.02
    for name in BEST:
        assert found[name] < BEST[name]


def test_each_is_blind_to_what_it_does_not_look_at(events):
    still, moved = scores(events, events), scores(damage.polarity_flipped(events), events)
    for name in ("log_rate_error", "rate_map_correlation", "interval_distance"):
        assert moved[name] == still[name]
    assert moved["polarity_error"] == pytest.approx(abs(1 - 2 * events.p.mean()))
    assert moved["chamfer_distance"] > still["chamfer_distance"]
    locked = scores(damage.frame_locked(events, FRAMES), events)
    assert locked["phase_locking_error"] > 0.9
    assert locked["rate_map_correlation"] > 0.95


def test_rates_by_hand():
    assert log_rate_error(stream([0, 1, 2]), stream([5])) == pytest.approx(math.log(2))
    assert polarity_error(stream([0, 1], p=[1, 1]), stream([0, 1, 2, 3], p=[1, 0, 0, 0])) == 0.75
    assert polarity_error(stream([]), stream([0, 1], p=[1, 0])) == 0
    assert rate_map_correlation(stream([]), stream([0])) == 0


def test_intervals_and_beats_by_hand():
    slow, fast = stream([0, 1000, 2000]), stream([0, 10, 20])
    assert interval_distance(slow, fast) == pytest.approx(2)
    # Two pixels in turn: their own intervals count, not those between neighbours in time.
    assert interval_distance(stream([0, 5, 1000, 1005], x=[0, 1, 0, 1]), slow) == pytest.approx(0)
    assert interval_distance(stream([]), stream([0, 1000])) == pytest.approx(0)
    frames = np.array([0, 100, 300])
    locked, spread = stream([25, 150]), stream([25, 75, 150, 250])
    assert phase_locking_error(locked, spread, frames) == pytest.approx(1)
    assert phase_locking_error(stream([]), spread, frames) == pytest.approx(0)


def test_distances_between_points_by_hand():
    left, right = stream([0], x=[0]), stream([0], x=[7])

    def distances(first, second, windows=1):
        found = point_baselines(first, second, start_us=0, window_us=50_000, windows=windows)
        return list(found.values())

    assert distances(left, right) == pytest.approx([100, 1])
    assert distances(left, left) == [0, 0]
    assert distances(left, right, windows=20) == pytest.approx([100 / 20, 1 / 20])
    assert distances(stream([]), right)[1] == pytest.approx(1)
    # Half a window is 500 scaled units of time.
    assert distances(stream([25_000]), left)[0] == pytest.approx(500)


def test_tensor_baselines_by_hand():
    silence, full = torch.zeros(3, 20, 24, 24), torch.full((3, 20, 24, 24), 10.0)
    chunk = torch.stack([silence, full], dim=1)
    found = tensor_baselines([chunk[:2], chunk[2:]], count_cutoff=10)
    assert found["voxel_psnr"] == pytest.approx(0)
    assert found["raw_cosine"] == 0
    assert found["voxel_ssim"] < 0.01
    half = torch.stack([0.5 * full, full], dim=1)
    assert tensor_baselines([half], 10)["raw_cosine"] == pytest.approx(1)
    assert tensor_baselines([half], 10)["count_cosine"] == pytest.approx(1)
    assert found["count_cosine"] == 0
    left = full.clone()
    left[..., 12:] = 0  # half of what is there
    parts = torch.stack([left, full], dim=1)
    one, several = tensor_baselines([parts], 10), tensor_baselines([parts[:1], parts[1:]], 10)
    assert one["count_cosine"] == several["count_cosine"] == pytest.approx(math.sqrt(0.5))
    assert tensor_baselines([half], 10)["voxel_psnr"] == pytest.approx(20 * math.log10(2))


@pytest.mark.parametrize("name", ["blank", "poisson"])
def test_values_are_never_silently_missing(events, name):
    made = damage.blank(events) if name == "blank" else damage.poisson(events)
    found = scores(made, events)
    assert found.keys() == scores(events, events).keys()
    assert all(np.isfinite(value) for value in found.values())
    if name == "blank":
        assert found["raw_cosine"] == 0
    else:  # as many events, evenly spread as those are
        assert found["log_rate_error"] < 0.05


def test_other_sensors_are_refused(events):
    with pytest.raises(ValueError, match="one sensor size"):
        scores(stream([0], width=3), events)


def test_frechet_distance_of_a_shift_is_its_square_whatever_the_order():
    torch.manual_seed(0)
    real = [torch.randn(6, 3, 4, 5), torch.randn(6, 2, 2, 2)]
    shifted = [(real[0] + 0.5).flip(0), (real[1] - 2.0).flip(0)]
    pairs = [torch.stack(streams, 1) for streams in zip(real, shifted, strict=True)]
    frechet = FeatureFrechet("hidden")
    for part in (slice(0, 2), slice(2, 6)):
        frechet({"hidden": [pair[part] for pair in pairs]})
    expected = (3 * 0.5**2 + 2 * 2.0**2) / 2
    assert frechet.values()[0] == pytest.approx(expected, rel=1e-3)


def test_frechet_distance_forgets_place_and_time_but_not_spread():
    torch.manual_seed(0)
    real = torch.randn(6, 3, 4, 5)
    moved, wider = real.flip(0).roll(2, dims=3), 3 * (real - real.mean((0, 2, 3), keepdim=True))
    frechet = FeatureFrechet("gate")
    frechet({"gate": [torch.stack([real, moved, wider], 1)]})
    same, spread = frechet.values()
    assert same == pytest.approx(0, abs=1e-4)
    covariance = torch.cov(real.movedim(1, 0).flatten(1))
    # Means differ by the real one; each eigenvalue v meets 9 v: v + 9 v - 2 * 3 v.
    expected = 4 * covariance.trace() + real.mean((0, 2, 3)).square().sum()
    assert spread == pytest.approx(float(expected), rel=1e-3)
