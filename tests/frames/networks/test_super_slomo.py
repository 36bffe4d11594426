"""Super SloMo: its equation, what its networks are shown, and which checkpoints are taken."""

import datetime

import numpy as np
import pytest
import torch
from layouts import super_slomo

from eqs.frames.networks import network_of
from eqs.frames.networks.super_slomo import FLOWS, FRAMES, SuperSloMo


def picture(height=40, width=60, colour=False, shift=0.0):
    """A smooth picture, moved to the right."""
    columns = np.arange(width) - shift
    rows = np.arange(height)[:, None]
    grey = 120 + 60 * np.sin(columns / 5.0) + 40 * np.cos(rows / 4.0)
    return (np.stack([grey, 0.5 * grey, 255 - grey], axis=-1) if colour else grey).astype(
        np.float32
    )


@pytest.mark.parametrize("planes", [1, 3])
@pytest.mark.parametrize("colour", [False, True])
@pytest.mark.parametrize("size", [(40, 60), (33, 65)])
def test_equal_frames_give_that_frame(saved, planes, colour, size):
    frame = picture(*size, colour=colour)
    made = network_of(saved(super_slomo(planes)))(frame, frame, [0.01, 0.5, 0.99])
    assert len(made) == 3
    for each in made:
        np.testing.assert_allclose(each, frame, atol=1e-2)


@pytest.mark.parametrize("planes", [1, 3])
@pytest.mark.parametrize("colour", [False, True])
def test_what_moves_is_where_its_share_says(saved, planes, colour):
    # Six pixels to the right, and back; the last rectifier leaves a tenth of what is negative.
    between = network_of(saved(super_slomo(planes, bias=(6.0, 0.0, -60.0, 0.0))))
    first, second = picture(colour=colour), picture(colour=colour, shift=6)
    shares = [0.01, 0.25, 0.99]
    for made, share in zip(between(first, second, shares), shares, strict=True):
        truth = picture(colour=colour, shift=6 * share)
        assert np.abs(made - truth)[:, 6:-6].max() < 1


def test_a_frame_that_cannot_see_a_pixel_does_not_tell_it(saved):
    first, second = picture(), picture(shift=3)
    (by_first,) = network_of(saved(super_slomo(logit=50.0)))(first, second, [0.5])
    np.testing.assert_allclose(by_first, first, atol=1e-2)
    # A tenth of -500 is left, which is enough.
    (by_second,) = network_of(saved(super_slomo(logit=-500.0)))(first, second, [0.5])
    np.testing.assert_allclose(by_second, second, atol=1e-2)


def test_still_frames_are_faded_by_time(saved):
    first, second = picture(), 0.5 * picture()
    (made,) = network_of(saved(super_slomo()))(first, second, [0.25])
    np.testing.assert_allclose(made, 0.75 * first + 0.25 * second, atol=1e-2)


class Shown(torch.nn.Module):
    """Keeps what it is shown, says a constant."""

    def __init__(self, says):
        super().__init__()
        self.says, self.seen = torch.tensor(says), []

    def forward(self, planes):
        self.seen.append(planes)
        return self.says[None, :, None, None].expand(len(planes), -1, *planes.shape[2:])


def test_the_networks_see_frames_less_their_mean_in_the_published_order():
    mean = 0.428
    flows, frames = Shown([2.0, 0.0, -1.0, 0.0]), Shown([0.0] * 5)
    network = SuperSloMo(flows, frames, torch.full((1, 1, 1, 1), mean))
    first, second = torch.rand(2, 1, 1, 8, 9, generator=torch.Generator().manual_seed(0))
    made = list(network.between(first, second, [0.25, 0.5]))
    assert len(made) == len(frames.seen) == 2
    (pair,) = flows.seen  # once for all shares
    torch.testing.assert_close(pair, torch.cat([first, second], dim=1) - mean)
    seen = frames.seen[0][0]
    torch.testing.assert_close(seen[:2], pair[0])
    # Flow to second and first: equation 4 with t = 1/4 of (2, 0) there and (-1, 0) back.
    columns = [2.0, 0.0, -1.0, 0.0, 0.75**2 * 2 + 0.1875, 0.0, -0.1875 * 2 - 0.0625, 0.0]
    assert seen[2:10].amax(dim=(1, 2)).tolist() == pytest.approx(columns, abs=1e-6)
    assert len(seen) == 12
    # The moved first frame is read 0.4375 pixels to the left, between two columns.
    expected = 0.4375 * pair[0, 0, :, :-1] + 0.5625 * pair[0, 0, :, 1:]
    torch.testing.assert_close(seen[11][:, 1:], expected, rtol=0, atol=1e-5)


def test_what_checkpoints_note_beside_the_weights_does_not_matter(saved):
    notes = {
        "Detail": "a training", "epoch": 39, "timestamp": datetime.datetime(2019, 5, 27, 1, 2, 3),
        "loss": [[0.1, np.float64(0.2)], [np.float32(3)]], "learningRate": 1e-4,
    }  # fmt: skip
    content = super_slomo()
    parallel = {
        name: {f"module.{key}": tensor.half() for key, tensor in content[name].items()}
        for name in (FLOWS, FRAMES)
    }
    first, second = picture(), picture(shift=3)
    expected = network_of(saved(content))(first, second, [0.3])
    for old in (False, True):  # as PyTorch saved before 1.6, and since
        path = saved({**notes, **parallel}, "noted.ckpt", _use_new_zipfile_serialization=not old)
        np.testing.assert_array_equal(network_of(path)(first, second, [0.3]), expected)


def test_python_objects_are_refused_with_the_way_to_strip_them(saved):
    path = saved({**super_slomo(), "args": pytest.Stash()})
    with pytest.raises(ValueError, match=r"nothing but tensors, .*save its weights alone: torch"):
        network_of(path)


def test_other_networks_are_refused(saved):
    content = super_slomo()
    content[FLOWS]["conv1.weight"] = torch.zeros(32, 8, 7, 7)
    with pytest.raises(ValueError, match=r"one or three planes, got one whose conv1.weight in"):
        network_of(saved(content))
    content = super_slomo()
    del content[FRAMES]["up3.conv2.bias"]
    with pytest.raises(ValueError, match=r"\(128,\) as up3.conv2.bias, got none; .* no Super"):
        network_of(saved(content))
    content[FRAMES] = super_slomo(planes=3)[FRAMES]
    with pytest.raises(ValueError, match=r"\(32, 12, 7, 7\) as conv1.weight, got \(32, 20"):
        network_of(saved(content))


@pytest.mark.parametrize("weights", [None, {}, {1: 2}, {"conv1.weight": 3}])
def test_checkpoints_without_weights_are_refused(saved, weights):
    with pytest.raises(ValueError, match=r"conv1.weight in state_dictFC is None in"):
        network_of(saved({FLOWS: weights, FRAMES: weights}))


def test_loading_draws_no_random_numbers(saved):
    path = saved(super_slomo())
    torch.manual_seed(3)
    expected = torch.rand(4)
    torch.manual_seed(3)
    network_of(path)
    assert torch.equal(torch.rand(4), expected)
