"""TorchScript: the share as a float or a tensor, grey or colour by the first convolution."""

import warnings

import numpy as np
import pytest
import torch
from torch import Tensor

from eqs.frames.networks import network_of
from eqs.frames.networks.scripted import deprecation_unsaid, is_script


def frames(*shape, seed=0):
    return np.random.default_rng(seed).integers(0, 256, (2, *shape)).astype(np.float32)


class ByTensor(torch.nn.Module):
    """Called as FILM is; a convolution that changes nothing tells the channels."""

    def __init__(self, channels: int = 3):
        super().__init__()
        self.conv = torch.nn.Conv2d(channels, channels, 1, bias=False)
        self.conv.weight.data = torch.eye(channels)[..., None, None]

    def forward(self, x0: Tensor, x1: Tensor, batch_dt: Tensor) -> Tensor:
        assert batch_dt.shape == (x0.shape[0], 1)
        share = batch_dt[:, :, None, None]
        return self.conv(x0) * (1.0 - share) + self.conv(x1) * share


class ByFloat(ByTensor):
    def forward(self, x0: Tensor, x1: Tensor, share: float) -> Tensor:
        return self.conv(x0) * (1.0 - share) + self.conv(x1) * share


class Spare(ByTensor):
    def forward(self, x0: Tensor, x1: Tensor, share: float, scale: float = 1.0) -> Tensor:
        return scale * self.conv(x0) * (1.0 - share) + self.conv(x1) * share


class NoShare(torch.nn.Module):
    def forward(self, x0: Tensor, x1: Tensor) -> Tensor:
        return 0.5 * (x0 + x1)


class TooMuch(torch.nn.Module):
    def forward(self, x0: Tensor, x1: Tensor, share: float, flow: Tensor) -> Tensor:
        return x0 + flow * share


@pytest.mark.parametrize("kind", [ByTensor, ByFloat, Spare])
@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("shape", [(5, 7), (65, 9, 3), (64, 64)])
def test_frames_are_where_their_shares_say(scripted, kind, channels, shape):
    first, second = frames(*shape)
    shares = [0.001, 0.25, 0.999]
    made = network_of(scripted(kind(channels)))(first, second, shares)
    for frame, share in zip(made, shares, strict=True):
        np.testing.assert_allclose(frame, (1 - share) * first + share * second, atol=1e-3)
    assert np.abs(made[0] - first).max() < 1 > np.abs(made[-1] - second).max()


def test_half_precision_runs_in_single(scripted):
    first, second = frames(8, 9, 3)
    (made,) = network_of(scripted(ByTensor().half()))(first, second, [0.5])
    np.testing.assert_allclose(made, 0.5 * (first + second), atol=1e-3)


def test_the_same_call_gives_the_same_frame_however_often(scripted):
    class Deep(ByTensor):
        def __init__(self):
            super().__init__()
            torch.manual_seed(0)
            self.more = torch.nn.Conv2d(3, 3, 5, padding=2)

        def forward(self, x0: Tensor, x1: Tensor, batch_dt: Tensor) -> Tensor:
            return torch.sigmoid(self.more(torch.tanh(self.conv(x0)) * 3.1 + x1 / 7.0))

    between = network_of(scripted(Deep()))
    first, second = frames(40, 50, 3)
    made = [between(first, second, [0.3])[0] for _ in range(5)]
    assert all(np.array_equal(made[0], frame) for frame in made[1:])


@pytest.mark.parametrize(
    ("kind", "shown"), [(NoShare, "x0: Tensor, x1: Tensor"), (TooMuch, ".*flow: Tensor")]
)
def test_other_signatures_are_refused(scripted, kind, shown):
    with pytest.raises(ValueError, match=rf"two tensors and a share, .*got forward\({shown}\) in"):
        network_of(scripted(kind()))


def test_a_broken_script_ends_in_a_sentence(scripted, tmp_path):
    import zipfile

    broken = tmp_path / "broken.pt"
    with zipfile.ZipFile(broken, "w") as file:
        file.writestr("broken/constants.pkl", b"nothing")
    assert is_script(broken)
    with pytest.raises(ValueError, match="Expected a TorchScript file that PyTorch can read at"):
        network_of(broken)


@pytest.mark.parametrize("category", [DeprecationWarning, FutureWarning])
def test_only_the_deprecation_of_scripts_is_kept_from_users(category):
    with deprecation_unsaid():
        warnings.warn("`torch.jit.load` is deprecated.", category, stacklevel=1)
    with pytest.warns(category, match="something else"), deprecation_unsaid():
        warnings.warn("something else", category, stacklevel=1)
