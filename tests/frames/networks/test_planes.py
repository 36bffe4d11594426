"""Frames become tensors of the planes and sizes that a network takes, and come back."""

import numpy as np
import pytest
import torch

from eqs.frames.networks.planes import SIDES_PX, on_frames, padded, warped


def frames(*shape, seed=0):
    return np.random.default_rng(seed).integers(0, 256, (2, *shape)).astype(np.float32)


def first_of(first, second, shares):
    for _ in shares:
        yield first


@pytest.mark.parametrize("channels", [1, 2, 3, 6, None, 40])
@pytest.mark.parametrize("shape", [(5, 7), (64, 130), (5, 7, 3), (1, 1), (1, 70, 3)])
def test_a_frame_comes_back_as_it_went(channels, shape):
    first, second = frames(*shape)
    (made,) = on_frames(first_of, channels)(first, second, [0.5])
    np.testing.assert_allclose(made, first, atol=1e-4)


@pytest.mark.parametrize(
    ("channels", "shape", "seen"),
    [
        (1, (5, 7), (1, 1)), (2, (5, 7), (1, 1)), (3, (5, 7), (1, 3)), (6, (5, 7), (1, 3)),
        (1, (5, 7, 3), (3, 1)), (6, (5, 7, 3), (1, 3)), (None, (5, 7), (1, 1)),
        (None, (5, 7, 3), (1, 3)),
    ],
)  # fmt: skip
def test_a_network_sees_the_planes_it_takes_in_a_size_it_can_halve(channels, shape, seen):
    sizes = []

    def network(first, second, shares):
        sizes.extend([first.shape, second.shape])
        return first_of(first, second, shares)

    on_frames(network, channels)(*frames(*shape), [0.5])
    assert sizes == [(*seen, SIDES_PX, SIDES_PX)] * 2


def test_colours_of_a_grey_frame_are_averaged():
    def network(first, second, shares):
        yield first * torch.tensor([0.5, 1.0, 0.3])[None, :, None, None]

    first, second = frames(5, 7)
    (made,) = on_frames(network, 3)(first, second, [0.5])
    np.testing.assert_allclose(made, 0.6 * first, rtol=1e-5)


def test_padding_repeats_the_last_row_and_column():
    tensor = torch.arange(6.0).reshape(1, 1, 2, 3)
    larger = padded(tensor)
    assert larger.shape == (1, 1, 64, 64)
    assert (larger[..., 1:, 2:] == 5).all()
    assert larger[0, 0, 0, 2:].unique().tolist() == [2]
    assert padded(larger) is larger


def test_a_network_that_makes_other_sizes_is_refused():
    for wrong, got in ((lambda x: x[..., :8], r"\(1, 1, 64, 8\)"), (lambda x: (x,), "tuple")):

        def network(first, second, shares, wrong=wrong):
            yield wrong(first)

        with pytest.raises(ValueError, match=f"one tensor .1, 1, 64, 64. of two such, got {got}"):
            on_frames(network, 1)(*frames(5, 7), [0.5])


def test_a_whole_number_of_pixels_moves_a_picture_without_blur():
    picture = torch.rand(1, 2, 20, 31, generator=torch.Generator().manual_seed(0))
    flow = torch.zeros(1, 2, 20, 31)
    torch.testing.assert_close(warped(picture, flow), picture, rtol=0, atol=1e-5)
    flow[:, 0], flow[:, 1] = 3, -2  # read three columns to the right and two rows above
    moved = warped(picture, flow)
    torch.testing.assert_close(moved[..., 2:, :-3], picture[..., :-2, 3:], rtol=0, atol=1e-5)
    edge = picture[..., :-2, -1:].expand(-1, -1, -1, 3)
    torch.testing.assert_close(moved[..., 2:, -3:], edge, rtol=0, atol=1e-5)
