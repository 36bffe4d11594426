"""Colours of the street: what substances reflect and lamps and sky send out, 400 to 700 nm.

The curves are made up after well known ones, at seven wavelengths and with lines in between: leaves
are green for want of chlorophyll's absorption at 550 nm, skin has haemoglobin's dip there, brick
and asphalt rise towards red, titanium white swallows violet. They give colour, not measurements.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from eqs.frames import QUANTUM_EFFICIENCY
from eqs.scenes.substances import Substance

Spectrum = NDArray[np.float64]

WAVELENGTHS_NM: Final[Spectrum] = np.linspace(400.0, 700.0, 31)
ANCHORS_NM: Final = np.linspace(400.0, 700.0, 7)
BRIGHTEST: Final = 0.92  # no surface sends back more, at no wavelength
DARKEST: Final = 0.01  # and none less
SUN_K: Final = 5500.0
SKY_K: Final = 10_000.0
LAMP_K: Final = 3200.0
RADIATION_NM_K: Final = 1.4388e7  # second radiation constant

# Relative reflectance at 400, 450, ... 700 nm.
SHAPES: Final[Mapping[Substance, tuple[float, ...]]] = {
    Substance.ASPHALT: (0.85, 0.90, 0.95, 1.00, 1.05, 1.08, 1.10),
    Substance.PAVING: (0.70, 0.82, 0.93, 1.03, 1.10, 1.14, 1.17),
    Substance.WHITE_PAINT: (0.55, 1.05, 1.08, 1.08, 1.08, 1.08, 1.08),
    Substance.BRICK: (0.35, 0.40, 0.50, 0.75, 1.40, 1.75, 1.85),
    Substance.PLASTER: (0.65, 0.82, 0.95, 1.07, 1.13, 1.16, 1.18),
    Substance.FOLIAGE: (0.50, 0.55, 0.75, 1.70, 1.15, 0.80, 1.55),
    Substance.BARK: (0.60, 0.70, 0.82, 1.00, 1.17, 1.30, 1.41),
    Substance.RUBBER: (1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0),
    Substance.METAL: (0.94, 0.97, 0.99, 1.00, 1.02, 1.04, 1.05),
    Substance.HEADLAMP: (1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0),
    Substance.TAIL_LAMP: (0.15, 0.12, 0.12, 0.15, 0.90, 2.60, 2.90),
    Substance.CLOTH: (0.75, 0.85, 0.95, 1.00, 1.07, 1.16, 1.22),
    Substance.DENIM: (1.35, 1.60, 1.30, 0.85, 0.65, 0.65, 0.80),
    Substance.SKIN: (0.50, 0.65, 0.85, 0.85, 1.20, 1.42, 1.50),
    Substance.HAIR: (0.70, 0.78, 0.88, 1.00, 1.12, 1.22, 1.30),
    Substance.EARTH: (0.45, 0.55, 0.75, 1.00, 1.25, 1.45, 1.55),
    Substance.GLASS: (0.95, 0.98, 1.02, 1.04, 1.02, 1.00, 0.98),
}
# Red, blue and silver: paints differ from one thing to the next.
PAINTS: Final = (
    (0.30, 0.25, 0.25, 0.35, 1.30, 2.20, 2.40),
    (1.60, 2.10, 1.50, 0.80, 0.45, 0.40, 0.50),
    (0.97, 1.00, 1.01, 1.01, 1.00, 1.00, 0.99),
)


def normalised(spectrum: Spectrum) -> Spectrum:
    """A spectrum whose photocurrent is that of one that is flat at one."""
    efficiency = np.array(QUANTUM_EFFICIENCY)
    scaled: Spectrum = spectrum * (efficiency.sum() / (efficiency * spectrum).sum())
    return scaled


def reflectance(substance: Substance, albedo: float, number: int = 0) -> Spectrum:
    """Reflectance of a substance at the wavelengths, shape (31,).

    In flat light its photocurrent is that of a grey of this albedo, so that a coloured street is as
    bright as the painted one. Where a bright colour would reflect too much at a wavelength, it is
    paler.

    Args:
        substance: which.
        albedo: mean reflectance as the camera sees it.
        number: of the thing it is on, which chooses among the paints.

    Example:
        >>> leaf = reflectance(Substance.FOLIAGE, 0.1)
        >>> [float(leaf[k].round(3)) for k in (0, 15, 20)]
        [0.05, 0.17, 0.115]
    """
    seen = min(max(albedo, DARKEST), BRIGHTEST)
    anchors = SHAPES.get(substance, PAINTS[number % len(PAINTS)])
    shape = normalised(np.interp(WAVELENGTHS_NM, ANCHORS_NM, anchors)) - 1.0
    room = BRIGHTEST / seen - 1.0
    paler = min(1.0, room / max(float(shape.max()), 1e-6))
    return seen * (1.0 + paler * shape)


def glow(kelvin: float) -> Spectrum:
    """Light of a black body, normalised, shape (31,). Source: Planck's law.

    Example:
        >>> bool(glow(10_000)[0] > glow(10_000)[-1]), bool(glow(3200)[0] < glow(3200)[-1])
        (True, True)
    """
    ratio = RADIATION_NM_K / (WAVELENGTHS_NM * kelvin)
    return normalised(WAVELENGTHS_NM**-5.0 / np.expm1(ratio))


def lamp(substance: Substance) -> Spectrum:
    """Light of a lamp behind its glass, normalised, shape (31,)."""
    return normalised(glow(LAMP_K) * reflectance(substance, 0.3))
