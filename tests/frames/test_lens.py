"""A lens before flat images: what each of its parts does, and what a pixel sees of it."""

import numpy as np
import pytest

from eqs.frames import GreyImage, Lens
from eqs.simulators import ESIM, V2E

NONE = {"vignetting": 0.0, "blur_px": 0.0}


def behind(lens, frame):
    seen = lens.seen(GreyImage.from_frame(frame))
    return seen.levels[seen.codes].reshape(frame.shape)


@pytest.fixture
def picture():
    return np.random.default_rng(0).uniform(20, 230, (24, 32))


def test_a_lens_without_faults_changes_nothing(picture):
    np.testing.assert_array_equal(behind(Lens(**NONE), picture), picture)


def test_a_logarithmic_pixel_without_dark_current_does_not_see_vignetting():
    frames = np.random.default_rng(3).uniform(1, 255, (6, 12, 16))
    times = 40_000 * np.arange(6)
    plain = ESIM(log_offset=1e-15)
    dim = ESIM(log_offset=1e-15, lens=Lens(vignetting=1.0, blur_px=0.0, field_of_view_deg=100))
    one, other = (each.simulate(frames, times) for each in (plain, dim))
    assert len(one) == len(other)
    order = [np.lexsort((each.t, each.x, each.y)) for each in (one, other)]
    for name in "xyp":
        same = [getattr(each, name)[by] for each, by in zip((one, other), order, strict=True)]
        np.testing.assert_array_equal(*same)
    assert np.abs(one.t[order[0]] - other.t[order[1]]).max() <= 1
    # What is linear in the dark does.
    assert len(V2E().simulate(frames, times)) != len(V2E(lens=dim.lens).simulate(frames, times))


def test_the_corner_is_darker_by_the_fourth_power_of_the_cosine():
    flat = np.full((11, 21), 100.0)
    seen = behind(Lens(vignetting=1.0, field_of_view_deg=90, blur_px=0.0), flat)
    tangent = np.hypot(5, 10) / 10.5
    assert seen[0, 0] == pytest.approx(100 * np.cos(np.arctan(tangent)) ** 4)
    assert seen[5, 10] == 100


def test_blur_keeps_the_light_and_has_its_width():
    frame = np.zeros((41, 41))
    frame[20, 20] = 200.0
    seen = behind(Lens(vignetting=0.0, blur_px=2.0), frame)
    assert seen.sum() == pytest.approx(200)
    rows = np.arange(41) - 20
    spread = np.sqrt((seen.sum(axis=1) * rows**2).sum() / 200)
    assert spread == pytest.approx(2.0, rel=0.05)  # it is cut off after three of them


def test_distortion_moves_what_lies_off_the_middle(picture):
    columns = np.tile(np.arange(41.0), (31, 1))
    lens = Lens(**NONE, distortion_k1=0.2, field_of_view_deg=90)
    seen = behind(lens, columns)
    ratio = 15 / 20.5
    assert seen[15, 20] == 20
    assert seen[15, 35] == pytest.approx(min(20 + 15 * (1 + 0.2 * ratio**2), 40))
    inverse = behind(Lens(**NONE, distortion_k1=-0.2, field_of_view_deg=90), columns)
    assert inverse[15, 35] == pytest.approx(20 + 15 * (1 - 0.2 * ratio**2))


def test_wrong_values_are_named_and_the_right_ones_are_in_the_label():
    for name, value in (
        ("vignetting", 1.5), ("field_of_view_deg", 180), ("blur_px", -1), ("distortion_k1", 2),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=rf"Expected {name} .*; set lens\.{name}"):
            Lens(**{name: value})
    assert "lens" not in ESIM().parameters()
    assert ESIM(lens=Lens()).parameters()["lens"]["blur_px"] == 0.5
