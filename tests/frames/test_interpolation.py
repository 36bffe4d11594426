"""Frames between the frames: cross-fades, optical flow, networks, and what is kept on disk."""

import hashlib
import subprocess
import sys
import warnings

import numpy as np
import pytest
import torch

from eqs.frames import (
    CachedInterpolation,
    FlowInterpolation,
    LinearInterpolation,
    NetworkInterpolation,
)
from eqs.frames.flow import optical_flow


def bar(column, dtype=np.uint8, width=64, height=48):
    """A smooth bright bar whose middle lies at a column, anywhere between pixels."""
    profile = 40 + 180 * np.exp(-(((np.arange(width) - column) / 4.0) ** 2))
    rows = 1 + 0.2 * np.sin(np.arange(height) / 3.0)[:, None]
    return np.clip(profile * rows, 0, 255).astype(dtype)


def middle(frame):
    """Column of the bar."""
    weight = np.clip(frame.astype(float).mean(0) - 60, 0, None) ** 2
    return (weight * np.arange(frame.shape[1])).sum() / weight.sum()


def test_cross_fades_are_weighted_means():
    first, second = np.full((2, 3), 10, np.uint8), np.full((2, 3), 30, np.uint8)
    made = LinearInterpolation(factor=4).between(first, second)
    assert made[:, 0, 0].tolist() == [15, 20, 25]
    floating = LinearInterpolation(factor=4).between(first / 1.0, second + 0.5)
    assert floating[:, 0, 0].tolist() == [15.125, 20.25, 25.375]
    assert LinearInterpolation(factor=1).between(first, second).shape == (0, 2, 3)


@pytest.mark.parametrize("colour", [False, True])
def test_flow_moves_what_a_cross_fade_doubles(colour):
    frames = [bar(24.0), bar(32.0)]
    if colour:
        frames = [np.stack([frame] * 3, axis=-1) for frame in frames]
    made = FlowInterpolation(factor=4).between(*frames)
    assert made.shape == (3, *frames[0].shape)
    grey = made[..., 0] if colour else made
    assert [middle(frame) for frame in grey] == pytest.approx([26, 28, 30], abs=0.5)
    truth = bar(28.0).astype(float)
    doubled = LinearInterpolation(factor=2).between(bar(24.0), bar(32.0))[0]
    assert np.abs(grey[1] - truth).mean() < 0.3 * np.abs(doubled - truth).mean()


def test_flow_has_the_direction_of_the_motion():
    flow = optical_flow(bar(24.0), bar(29.0))
    assert np.median(flow[12:36, 20:29, 0]) == pytest.approx(5, abs=0.5)
    assert np.abs(np.median(flow[12:36, 20:29, 1])) < 0.5


def test_faster_motion_gets_more_frames():
    still, slow, fast = (
        len(FlowInterpolation().between(bar(24.0), bar(24.0 + shift))) for shift in (0, 3, 8)
    )
    assert still == 0
    assert 1 <= slow < fast
    assert len(FlowInterpolation(most_frames=4).between(bar(24.0), bar(32.0))) == 3
    assert len(FlowInterpolation(factor=6).between(bar(24.0), bar(24.0))) == 5


def test_a_network_of_ones_own(tmp_path):
    given = []

    def network(first, second, share):
        given.append(share)
        return (1 - share) * first + share * second

    made = NetworkInterpolation(network=network, factor=4).between(bar(20.0), bar(30.0))
    assert given == [0.25, 0.5, 0.75]
    assert np.array_equal(made, LinearInterpolation(factor=4).between(bar(20.0), bar(30.0)))


class Fade(torch.nn.Module):
    def forward(self, first: torch.Tensor, second: torch.Tensor, share: float) -> torch.Tensor:
        return first * (1.0 - share) + second * share


@pytest.fixture
def fade(tmp_path):
    """A file with a network that cross-fades; its maker hears that TorchScript is deprecated."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torch.jit.script(Fade()).save(str(tmp_path / "fade.pt"))
    return tmp_path / "fade.pt"


@pytest.mark.parametrize("shape", [(5, 6), (5, 6, 3)])
def test_a_network_in_a_file(fade, shape):
    rng = np.random.default_rng(0)
    first, second = rng.integers(0, 256, (2, *shape), dtype=np.uint8)
    interpolation = NetworkInterpolation(network=fade, factor=3)
    made = interpolation.between(first, second)
    expected = LinearInterpolation(factor=3).between(first, second)
    assert np.abs(made - expected).max() < 1e-3
    assert NetworkInterpolation(network=fade, factor=1).between(first, second).shape == (0, *shape)


def test_a_file_is_known_by_its_content(fade, tmp_path):
    known = NetworkInterpolation(network=fade).parameters()
    assert known["name"] == hashlib.sha256(fade.read_bytes()).hexdigest()
    moved = fade.rename(tmp_path / "other.pt")
    again = NetworkInterpolation(network=moved, made_by="a command").parameters()
    assert again == known


def test_a_file_that_is_missing_says_which_command_makes_it(tmp_path):
    gone = tmp_path / "none.pt"
    with pytest.raises(FileNotFoundError, match=r"none.pt, found none; set interpolation\.inner"):
        NetworkInterpolation(network=gone)
    wanted = r"none.pt, found none; type eqs fetch, or set interpolation\.inner\.network"
    with pytest.raises(FileNotFoundError, match=wanted):
        NetworkInterpolation(network=gone, made_by="eqs fetch")


def test_frames_of_a_file_are_kept_too(fade, tmp_path):
    inner = NetworkInterpolation(network=fade, factor=3)
    cached = CachedInterpolation(inner=inner, folder=tmp_path / "kept")
    made = cached.between(bar(20.0), bar(30.0))
    np.testing.assert_array_equal(made, inner.between(bar(20.0), bar(30.0)))
    fade.touch()
    np.testing.assert_array_equal(cached.between(bar(20.0), bar(30.0)), made)
    assert len(list((tmp_path / "kept").iterdir())) == 1


@pytest.mark.parametrize("kind", ["FlowInterpolation", "LinearInterpolation"])
def test_whoever_brings_no_network_loads_no_torch(kind):
    code = (
        f"import sys, numpy as np, eqs.frames as f; made = f.{kind}(factor=2); "
        "made.between(np.zeros((8, 8)), np.ones((8, 8))); sys.exit('torch' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_made_frames_are_kept_by_content(tmp_path):
    calls = []

    def network(first, second, share):
        calls.append(share)
        return first

    def cached(factor=3):
        inner = NetworkInterpolation(network=network, factor=factor)
        return CachedInterpolation(inner=inner, folder=tmp_path)

    first = cached().between(bar(20.0), bar(30.0))
    again = cached().between(bar(20.0), bar(30.0))
    assert np.array_equal(first, again)
    assert len(calls) == 2
    cached().between(bar(20.0), bar(31.0))
    cached(factor=4).between(bar(20.0), bar(30.0))
    assert len(calls) == 2 + 2 + 3
    assert len(list(tmp_path.iterdir())) == 3


@pytest.mark.parametrize("kind", [LinearInterpolation, FlowInterpolation])
@pytest.mark.parametrize("factor", [0, 2.5, True])
def test_factors_that_make_no_sense_are_refused(kind, factor):
    with pytest.raises(ValueError, match=r"from 1 up, got .*set interpolation\.factor"):
        kind(factor=factor)
    with pytest.raises(ValueError, match="largest_step_px above 0"):
        FlowInterpolation(largest_step_px=0)


@pytest.mark.parametrize("shape", [(1, 1), (5, 7), (11, 300), (300, 3), (12, 12)])
def test_flow_takes_frames_of_any_size(shape):
    first = np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8)
    made = FlowInterpolation(factor=3).between(first, first)
    assert made.shape == (2, *shape)
    np.testing.assert_allclose(made, np.stack([first, first]), atol=1e-3)
