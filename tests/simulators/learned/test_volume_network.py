"""A network of one's own: as a function or a file, of the right counts, judged by its teacher."""

import numpy as np
import pytest
import torch
from tiny_networks import contrast_counts

from eqs.simulators import ESIM, VolumeNetwork

TIMES = 50_000 * np.arange(6)


@pytest.fixture
def frames():
    return np.random.default_rng(0).integers(0, 256, (6, 12, 16), np.uint8)


def test_counts_of_crossed_levels_are_a_level_crossing_pixel(frames):
    """As ESIM is one, but for the phase at which it starts."""
    network = VolumeNetwork(network=contrast_counts)
    events = network.simulate(frames, TIMES)
    rise = frames[:2].copy()
    rise[0], rise[1] = 40, 90
    steady = network.simulate(rise, TIMES[:2])
    esim = ESIM(log_offset=1 / 255).simulate(rise, TIMES[:2])
    expected = np.log(91 / 41) / 0.2
    assert len(esim) == int(expected) * rise[0].size
    assert len(steady) == pytest.approx(expected * rise[0].size, rel=0.05)
    assert np.diff(np.sort(steady.t[(steady.x == 3) & (steady.y == 4)])).std() <= 1
    total = np.abs(np.diff(np.log(frames + 1.0), axis=0)).sum() / 0.2
    assert len(events) == pytest.approx(total, rel=0.01)


@pytest.mark.filterwarnings("ignore:.*torch.jit:DeprecationWarning")
def test_a_torchscript_file_gives_what_it_computes(tmp_path, frames):
    class Twice(torch.nn.Module):
        def forward(self, first: torch.Tensor, second: torch.Tensor) -> torch.Tensor:
            change = second - first
            counts = torch.cat([torch.relu(-change), torch.relu(change)], dim=1)
            return counts.repeat_interleave(5, dim=1)

    path = tmp_path / "network.pt"
    torch.jit.script(Twice()).save(str(path))
    events = VolumeNetwork(network=path).simulate(frames, TIMES)

    def same(first, second):
        change = (second - first) / np.float32(255)
        return np.repeat(np.stack([np.maximum(-change, 0), np.maximum(change, 0)])[:, None], 5, 1)

    expected = VolumeNetwork(network=same).simulate(frames, TIMES)
    assert len(events) == len(expected) > 100
    for name in "txyp":
        np.testing.assert_array_equal(getattr(events, name), getattr(expected, name))
    assert len(VolumeNetwork(network=path).parameters()["network"]) == 64


@pytest.mark.parametrize(
    ("counts", "message"),
    [
        (
            np.zeros((10, 12, 16)),
            r"shape \(2, bins, 12, 16\), OFF first, of the network, got \(10, 1",
        ),
        (
            np.full((2, 3, 12, 16), -0.1),
            r"not negative, got some from -0.1 to -0.1; set sim.net",
        ),
        (np.full((2, 3, 12, 16), np.inf), "finite and not negative"),
    ],
)
def test_what_is_no_expected_count_is_refused(counts, message, frames):
    with pytest.raises(ValueError, match=message):
        VolumeNetwork(network=lambda first, second: counts).simulate(frames, TIMES)


def test_frames_further_apart_than_it_learned_are_refused(frames):
    network = VolumeNetwork(network=contrast_counts, longest_us=40_000)
    with pytest.raises(ValueError, match=r"frames 0 to 40000 us apart.*got 50000 us.*longest_us"):
        network.simulate(frames, TIMES)


def test_a_missing_file_is_named():
    with pytest.raises(FileNotFoundError, match=r"TorchScript file at no.pt.*set sim\.network"):
        VolumeNetwork(network="no.pt")


def test_it_is_marked_where_its_teacher_judges():
    network = VolumeNetwork(network=contrast_counts, learned_from="dsec")
    assert network.caveat("dsec_mini") == ESIM().caveat("dsec") == ""
    assert "learned from the sensor that judges it" in network.caveat("dsec")
