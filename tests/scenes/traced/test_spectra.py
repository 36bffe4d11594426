"""Colours that are as bright as the greys they stand for."""

import numpy as np
import pytest

from eqs.frames import flat_response, photocurrent
from eqs.scenes.substances import Substance
from eqs.scenes.traced.spectra import (
    BRIGHTEST,
    WAVELENGTHS_NM,
    glow,
    lamp,
    normalised,
    reflectance,
)

RESPONSE = flat_response(WAVELENGTHS_NM)


@pytest.mark.parametrize("substance", Substance)
@pytest.mark.parametrize("albedo", [0.03, 0.3, 0.8])
def test_a_colour_is_as_bright_as_the_grey_it_stands_for(substance, albedo):
    for number in range(3):
        colour = reflectance(substance, albedo, number)
        assert photocurrent(colour[None], WAVELENGTHS_NM)[0] / RESPONSE == pytest.approx(albedo)
        assert (colour > 0).all()
        assert (colour <= BRIGHTEST + 1e-12).all()


def test_things_have_the_colours_they_are_known_for():
    def at(nm, spectrum):
        return float(np.interp(nm, WAVELENGTHS_NM, spectrum))

    leaf, brick = reflectance(Substance.FOLIAGE, 0.1), reflectance(Substance.BRICK, 0.25)
    assert at(550, leaf) > 1.5 * max(at(450, leaf), at(670, leaf))
    assert at(650, brick) > 3 * at(450, brick)
    red, blue, silver = (reflectance(Substance.CAR_PAINT, 0.2, number) for number in range(3))
    assert at(650, red) > 4 * at(450, red)
    assert at(450, blue) > 4 * at(650, blue)
    assert silver.std() < 0.05 * silver.mean()
    assert at(680, lamp(Substance.TAIL_LAMP)) > 10 * at(450, lamp(Substance.TAIL_LAMP))
    assert lamp(Substance.HEADLAMP) == pytest.approx(glow(3200))


def test_light_is_as_bright_as_flat_light():
    for kelvin in (3200, 5500, 10_000):
        assert photocurrent(glow(kelvin)[None], WAVELENGTHS_NM)[0] == pytest.approx(RESPONSE)
    assert normalised(np.full(31, 7.0)) == pytest.approx(np.ones(31))


def test_a_black_body_peaks_where_wien_says():
    peak_nm = WAVELENGTHS_NM[glow(5000).argmax()]
    assert peak_nm == pytest.approx(2.898e6 / 5000, abs=6)
