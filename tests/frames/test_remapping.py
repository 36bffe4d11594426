"""Remapping: DSEC's coverage, exactness where it is known, and no flicker of fine detail."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from eqs.frames import View, remapped
from eqs.frames.remapping import undistorted

# The five calibrations of DSEC's left cameras: matrix and distortion of the event camera, rotation
# vector into the rectified frame camera, and that one's focal length and centre.
DSEC = {
    "interlaken, thun": (
        (555.6627, 555.8306, 342.5725, 215.2683),
        (-0.0909434, 0.1833977, -0.0006982, 0.000414),
        (-0.0063822, 0.0122717, 0.0033015),
        (1164.6238, 713.5791, 570.9349),
    ),
    "zurich 00-03, 09, 10, 12, 14": (
        (556.7177, 556.5738, 342.4201, 215.1085),
        (-0.0979819, 0.2097934, -0.0003578, 6.72e-05),
        (-0.0081759, 0.0096659, 0.0032832),
        (1150.8249, 724.4121, 569.1058),
    ),
    "zurich 04, 05, 11": (
        (553.4687, 553.3994, 346.6534, 216.5209),
        (-0.0935648, 0.1944578, 7.64e-05, 0.0019564),
        (-0.0080159, 0.0140526, 0.0034785),
        (1150.8944, 723.4334, 572.1022),
    ),
    "zurich 06, 07, 13": (
        (554.1363, 554.2133, 341.323, 215.638),
        (-0.0952796, 0.1963012, -0.0005728, -0.0002063),
        (-0.0106042, 0.0077442, 0.0045073),
        (1148.2314, 726.4118, 568.2192),
    ),
    "zurich 08, 15": (
        (554.8898, 554.9228, 339.9859, 214.8458),
        (-0.0960269, 0.2001766, -0.0008818, -0.0012239),
        (-0.0107853, 0.0067826, 0.0044126),
        (1148.933, 726.3772, 569.4966),
    ),
}
NO_LENS = np.zeros(4)


def dsec_view(name):
    matrix, lens, turned, (focal, column, row) = DSEC[name]
    return View(
        matrix=np.array(matrix),
        distortion=np.array(lens),
        size=(480, 640),
        rotation=Rotation.from_rotvec(turned).as_matrix(),
        frame_matrix=np.array([focal, focal, column, row]),
        frame_size=(1080, 1440),
    )


def plain_view(size, frame_size, ratio):
    """A view without lens or rotation into an image that is `ratio` times finer."""
    focal = 50.0
    centre = np.array([(size[1] - 1) / 2, (size[0] - 1) / 2])
    frame_centre = np.array([(frame_size[1] - 1) / 2, (frame_size[0] - 1) / 2])
    return View(
        matrix=np.array([focal, focal, *centre]),
        distortion=NO_LENS,
        size=size,
        rotation=np.eye(3),
        frame_matrix=np.array([focal * ratio, focal * ratio, *frame_centre]),
        frame_size=frame_size,
    )


@pytest.mark.parametrize(
    ("name", "percent", "first_hole", "first_empty", "ratio"),
    [
        ("interlaken, thun", 94.1, 450, 458, 2.107),
        ("zurich 00-03, 09, 10, 12, 14", 94.8, 453, 462, 2.076),
        ("zurich 04, 05, 11", 94.5, 451, 461, 2.089),
        ("zurich 06, 07, 13", 94.5, 451, 460, 2.083),
        ("zurich 08, 15", 94.2, 450, 459, 2.081),
    ],
)
def test_frames_of_dsec_cover_the_rows_that_are_cropped_to(
    name, percent, first_hole, first_empty, ratio
):
    view = dsec_view(name)
    covered = view.covered()
    assert round(100 * covered.mean(), 1) == percent
    assert np.flatnonzero(~covered.all(axis=1))[0] == first_hole > 448
    assert np.flatnonzero(~covered.any(axis=1))[0] == first_empty
    columns, rows = view.positions(np.array([319.0, 320.0]), np.array([240.0, 240.0]))
    assert np.hypot(np.diff(columns), np.diff(rows))[0] == pytest.approx(ratio, abs=0.025)


def test_the_lens_is_undone_to_a_billionth():
    _, lens, _, _ = DSEC["zurich 04, 05, 11"]
    x, y = np.meshgrid(np.linspace(-0.63, 0.53, 30), np.linspace(-0.4, 0.48, 30))
    found_x, found_y = undistorted(x, y, np.array(lens))
    k1, k2, p1, p2 = lens
    r2 = found_x**2 + found_y**2
    radial = 1 + k1 * r2 + k2 * r2**2
    again = found_x * radial + 2 * p1 * found_x * found_y + p2 * (r2 + 2 * found_x**2)
    assert np.abs(again - x).max() < 1e-9
    with pytest.raises(ValueError, match="distortion that can be undone"):
        undistorted(x, y, np.array([-5.0, 0.0, 0.0, 0.0]))


def test_the_same_camera_sees_the_same_image():
    view = plain_view((20, 30), (20, 30), 1.0)
    image = np.random.default_rng(0).integers(0, 256, (20, 30, 3)).astype(np.uint8)
    assert (remapped(view.weights(samples=1), image, view.size) == image).all()


@pytest.mark.parametrize("samples", [1, 4])
def test_a_ramp_stays_a_ramp(samples):
    view = plain_view((20, 30), (60, 90), 2.0)
    columns = np.arange(90)
    image = np.broadcast_to(columns * 2, (60, 90)).astype(np.uint8)
    expected = 2 * (2 * (np.arange(30) - 14.5) + 44.5)
    found = remapped(view.weights(samples), image, view.size)
    assert (found == np.rint(expected).astype(int)).all()


def test_finer_detail_than_a_pixel_does_not_flicker():
    """Stripes that one image pixel shifts: their mean stays, a point sample turns over."""
    view = plain_view((20, 30), (60, 90), 2.0)
    stripes = np.broadcast_to(255 * (np.arange(90) % 2), (60, 90)).astype(np.uint8)
    smooth, sharp = view.weights(samples=4), view.weights(samples=1)
    for offset in (0, 1):
        image = np.roll(stripes, offset, axis=1)
        assert np.abs(remapped(smooth, image, view.size).astype(int) - 127.5).max() <= 0.5
    diagonal = plain_view((20, 30), (60, 90), 2.1).weights(samples=1)
    moved = [remapped(diagonal, np.roll(stripes, k, 1), view.size).astype(int) for k in (0, 1)]
    assert np.abs(moved[1] - moved[0]).max() > 200
    assert sharp.shape == smooth.shape == (600, 5400)


def test_weights_add_up_to_one_or_nothing():
    view = plain_view((20, 30), (30, 90), 2.0)  # rows above and below are not seen
    sums = np.asarray(view.weights().sum(axis=1)).reshape(view.size)
    covered = view.covered()
    assert 0 < covered.mean() < 1
    assert np.allclose(sums[covered], 1, atol=1e-5)
    assert (sums[~covered] == 0).all()
