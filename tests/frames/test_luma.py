"""Grey levels from colour, and the table form of an image."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eqs.frames import GreyImage, luma

BYTE = st.integers(0, 255)


@given(BYTE, BYTE, BYTE)
def test_rounded_luma_is_the_nearest_whole_number(red, green, blue):
    exact = (299 * red + 587 * green + 114 * blue) / 1000
    found = int(luma(np.uint8([[[red, green, blue]]]))[0, 0])
    assert abs(found - exact) <= 0.5


@given(BYTE)
def test_grey_in_colour_stays_what_it_is(level):
    assert luma(np.uint8([[[level] * 3]]))[0, 0] == level


def test_unrounded_luma_keeps_fractions():
    assert luma(np.uint8([[[1, 0, 0]]]), rounded=False)[0, 0] == pytest.approx(0.299)
    assert luma(np.float32([[[0, 1, 0]]]))[0, 0] == pytest.approx(0.587)


@pytest.mark.parametrize("dtype", [np.uint8, np.float32, np.float64])
def test_an_image_is_its_codes_looked_up(dtype):
    frame = np.random.default_rng(0).integers(0, 256, (5, 7)).astype(dtype)
    image = GreyImage.from_frame(frame)
    np.testing.assert_array_equal(image.levels[image.codes].reshape(5, 7), frame)
    assert (image.height, image.width) == (5, 7)


def test_an_image_does_not_follow_later_changes_of_the_frame():
    for dtype in (np.uint8, np.float64):
        frame = np.zeros((2, 2), dtype)
        image = GreyImage.from_frame(frame)
        frame[:] = 9
        assert image.levels[image.codes].tolist() == [0] * 4
