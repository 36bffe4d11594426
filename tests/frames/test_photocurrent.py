"""Spectra to photocurrents: closed forms, and events that do not tell flat spectra from grey."""

import numpy as np
import pytest

from eqs.frames import QUANTUM_EFFICIENCY, flat_response, photocurrent
from eqs.simulators import ESIM

BANDS = {count: np.linspace(400, 700, count) for count in (2, 7, 31)}


def test_the_table_is_the_published_one():
    assert len(QUANTUM_EFFICIENCY) == 31
    assert np.mean(QUANTUM_EFFICIENCY) == pytest.approx(28.54 / 31)
    assert max(QUANTUM_EFFICIENCY) == 1


@pytest.mark.parametrize("count", BANDS)
def test_flat_spectra_are_grey(count):
    grey = np.random.default_rng(0).uniform(0, 200, (3, 4, 5))
    flat = np.repeat(grey[..., None], count, axis=-1)
    current = photocurrent(flat, BANDS[count])
    assert current / flat_response(BANDS[count]) == pytest.approx(grey, rel=1e-12)


def test_a_simulator_cannot_tell_flat_spectra_from_grey_frames():
    grey = np.random.default_rng(1).uniform(20, 255, (6, 8, 9))
    flat = np.repeat(grey[..., None], 31, axis=-1)
    response = flat_response(BANDS[31])
    levels = photocurrent(flat, BANDS[31]) * (255 / (255 * response))
    times = np.arange(6) * 10_000
    one, other = (ESIM().simulate(np.clip(f, 0, 255), times) for f in (grey, levels))
    assert len(one) > 100
    for name in "xyp":
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert np.abs(one.t - other.t).max() <= 1


def test_one_bright_band_weighs_as_its_efficiency():
    spectra = np.zeros((31, 1, 1, 31))
    spectra[np.arange(31), 0, 0, np.arange(31)] = 31.0
    found = photocurrent(spectra, BANDS[31])[:, 0, 0]
    assert found == pytest.approx(QUANTUM_EFFICIENCY)
    assert photocurrent(spectra[:1, :, :, :1], [405.0]) == pytest.approx(31 * 0.5 * (0.82 + 0.85))


def test_it_is_linear_and_keeps_single_precision():
    rng = np.random.default_rng(2)
    one, other = rng.uniform(0, 1, (2, 1, 3, 3, 7)).astype(np.float32)
    both = photocurrent(one + other, BANDS[7])
    assert both.dtype == np.float32
    apart = photocurrent(one, BANDS[7]) + photocurrent(other, BANDS[7])
    assert both == pytest.approx(apart, rel=1e-5)


@pytest.mark.parametrize(
    ("bands", "said"),
    [
        ([400, 500], "Expected floating radiance with 2 bands .* shaped"),
        ([400, 500, 620], "increase in equal steps"),
        ([600, 500, 400], "increase in equal steps"),
        ([380, 500, 620], "from 400 to 700 nm"),
        ([], "set wavelengths_nm"),
    ],
)
def test_wavelengths_that_do_not_fit_are_refused(bands, said):
    with pytest.raises(ValueError, match=said):
        photocurrent(np.ones((1, 2, 2, 3)), bands)


def test_efficiencies_that_are_none_are_refused():
    for table in ([0.0, 0.0], [0.5, -0.1], [1.0]):
        with pytest.raises(ValueError, match="set efficiency"):
            photocurrent(np.ones((1, 1, 1, 1)), [500], table)
    with pytest.raises(ValueError, match="floating radiance"):
        photocurrent(np.ones((1, 1, 1, 1), np.uint8), [500])
