"""RIFE 4.25: how its blocks are put together, its blend, ours where nothing moves, its weights."""

from pathlib import Path

import numpy as np
import pytest
import torch
from layouts import rife

from eqs.benchmarks.interpolation import rendered
from eqs.frames import FlowInterpolation, LinearInterpolation, NetworkInterpolation
from eqs.frames.networks import network_of
from eqs.frames.networks.rife import FIRST_CHANNELS, Rife, blended

PUBLISHED = Path(__file__).parents[3] / "datasets/networks/rife_4.25.pt"
published = pytest.mark.skipif(
    not PUBLISHED.is_file(), reason="eqs fetch-interpolator rife gets the weights"
)
REST = [0.0] * 8  # features


def picture(height=50, width=60, shift=0.0, colour=False):
    """A smooth picture, moved to the right."""
    columns = np.arange(width) - shift
    grey = 120 + 60 * np.sin(columns / 5.0) + 40 * np.cos(np.arange(height)[:, None] / 4.0)
    return (np.stack([grey, 0.5 * grey, 255 - grey], axis=-1) if colour else grey).astype(
        np.float32
    )


def test_the_layout_is_that_of_the_published_weights():
    with torch.device("meta"):
        network = Rife()
    own = network.state_dict()
    assert len(own) == 198 - 40
    assert sum(tensor.numel() for tensor in own.values()) == 5_664_776
    assert own["block0.conv0.0.0.weight"].shape == (96, FIRST_CHANNELS, 3, 3)
    assert own["block4.lastconv.0.weight"].shape == (32, 52, 4, 4)


@pytest.mark.parametrize("colour", [False, True])
@pytest.mark.parametrize("share", [0.01, 0.5, 0.99])
def test_flows_add_up_at_their_scales_and_the_last_mask_counts(saved, colour, share):
    # Of four pixels to the right, half is said at the scale of two, so 1 there is 2 here.
    back, ahead = -4 * share, 4 * (1 - share)
    path = saved(
        rife(
            block3=[back / 4, 0.0, ahead / 4, 0.0, 90.0, *REST],
            block4=[back / 2, 0.0, ahead / 2, 0.0, -90.0, *REST],
        )
    )
    first, second = picture(colour=colour) - 30, picture(shift=4, colour=colour)
    (made,) = network_of(path)(first, second, [share])  # the last mask hides the darker one
    truth = picture(shift=4 * share, colour=colour)
    # Where the picture is flat, time alone blends.
    assert np.median(np.abs(made - truth)[:, 6:-6]) < 1


@pytest.mark.parametrize("shape", [(7, 9), (65, 40), (64, 64), (33, 40, 3)])
def test_frames_of_any_size_that_stand_still_are_faded_by_time(saved, shape):
    first, second = np.random.default_rng(0).integers(0, 256, (2, *shape)).astype(np.float32)
    shares = [0.001, 0.25, 0.75, 0.999]
    # A mask that would show the second frame alone.
    made = network_of(saved(rife(block4=[0.0] * 4 + [-90.0, *REST])))(first, second, shares)
    for frame, share in zip(made, shares, strict=True):
        np.testing.assert_allclose(frame, (1 - share) * first + share * second, atol=1e-3)
    assert np.abs(made[0] - first).max() < 1 > np.abs(made[-1] - second).max()


@pytest.mark.parametrize(
    ("displacement_px", "faded"), [(0.0, 1.0), (0.49, 1.0), (0.75, 0.5), (1.0, 0.0), (3.0, 0.0)]
)
def test_time_blends_below_half_a_pixel_and_the_mask_from_one_on(displacement_px, faded):
    # A slope of 8 levels a pixel, so that the flow changes what is read by more than two levels.
    slope = torch.arange(64.0).expand(1, 1, 64, 64) * 8 / 255
    pair = slope, slope + 0.1
    flow = torch.zeros(1, 4, 64, 64)
    flow[:, 0], flow[:, 2] = 5.0, 5.0 + displacement_px
    made = blended(pair, flow, torch.full((1, 1, 64, 64), 90.0), 0.5)[..., 10:50]
    of_mask, of_time = (slope + 5 * 8 / 255)[..., 10:50], (slope + 0.05)[..., 10:50]
    torch.testing.assert_close(made, faded * of_time + (1 - faded) * of_mask, atol=1e-4, rtol=0)


def test_a_flow_that_changes_nothing_is_none():
    flat = torch.full((1, 3, 64, 64), 100 / 255)
    flow = 40 * torch.randn(1, 4, 64, 64, generator=torch.Generator().manual_seed(0))
    made = blended((flat, 2 * flat), flow, torch.full((1, 1, 64, 64), 3.0), 0.25)
    torch.testing.assert_close(made, 1.25 * flat)


def test_what_served_training_is_left_out_and_nothing_else(saved):
    weights = rife()
    more = {"teacher.conv0.0.0.weight": torch.zeros(3), "caltime.0.bias": torch.zeros(1)}
    network_of(saved({f"module.{k}": v for k, v in {**weights, **more}.items()}))
    with pytest.raises(ValueError, match=r"RIFE 4.25, .*no weights as other.bias, got \(1,\)"):
        network_of(saved({**weights, "other.bias": torch.zeros(1)}))


def test_other_versions_are_refused_and_the_supported_one_is_named(saved):
    four = {name: tensor for name, tensor in rife().items() if not name.startswith("block4")}
    with pytest.raises(ValueError, match=r"4.25, .* got 4, the first on \[15\], .*fetch-interp"):
        network_of(saved(four))
    old = {**rife(), "block0.conv0.0.0.weight": torch.zeros(96, 7, 3, 3)}
    with pytest.raises(ValueError, match=r"the version supported here: .* the first on \[7\]"):
        network_of(saved(old))


@published
def test_flat_frames_fade_with_time():
    first, second = np.full((50, 70), 100, np.uint8), np.full((50, 70), 200, np.uint8)
    made = network_of(PUBLISHED)(first, second, [0.25, 0.5, 0.75])
    np.testing.assert_allclose(made[0], 125, atol=0.1)
    np.testing.assert_allclose(made[1], 150, atol=0.1)
    np.testing.assert_allclose(made[2], 175, atol=0.1)


@published
def test_the_same_frames_come_out_every_time_and_on_any_number_of_threads():
    frames, _ = rendered(1, (50, 70), 1)
    between = network_of(PUBLISHED)
    threads = torch.get_num_threads()
    made = []
    try:
        for count in (1, 2, 2):
            torch.set_num_threads(count)
            made.append(between(frames[0], frames[-1], [0.3, 0.6]))
    finally:
        torch.set_num_threads(threads)
    np.testing.assert_array_equal(made[0], made[1])
    np.testing.assert_array_equal(made[1], made[2])


@published
def test_it_follows_motion_about_as_well_as_optical_flow():
    frames, _ = rendered(1, (96, 128), 1)
    pair, truth = (frames[0], frames[20]), frames[5:20:5]

    def psnr_db(interpolation):
        error = np.mean((interpolation.between(*pair) - truth) ** 2)
        return 10 * np.log10(255**2 / error)

    faded, flow, rife = (
        psnr_db(each)
        for each in (
            LinearInterpolation(factor=4),
            FlowInterpolation(factor=4),
            NetworkInterpolation(network=PUBLISHED, factor=4),
        )
    )
    assert rife > faded + 1
    assert abs(rife - flow) < 3
