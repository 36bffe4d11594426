"""Surfaces as the ray tracer wants them described: dictionaries of its plugins."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from eqs.scenes.substances import Substance
from eqs.scenes.textures import Map, Mask
from eqs.scenes.traced.engine import engine
from eqs.scenes.traced.shapes import Look
from eqs.scenes.traced.spectra import Spectrum, lamp, reflectance

Plugin = dict[str, Any]

# A smooth dielectric over colour mirrors the sky at a slant, as window panes and car bodies do.
COATED: Final = (Substance.CAR_PAINT, Substance.GLASS)
PANE_ALBEDO: Final = 0.03  # of what is dark behind a window


def spectrum(values: Spectrum) -> Plugin:
    """A spectrum in equal steps from 400 to 700 nm."""
    listed = ",".join(f"{value:.6g}" for value in values)
    return {"type": "regular", "wavelength_min": 400.0, "wavelength_max": 700.0, "values": listed}


def surface(substance: Substance, albedo: float, number: int = 0) -> Plugin:
    """Both sides of a plain surface; `number` chooses among the paints."""
    colour = spectrum(reflectance(substance, albedo, number))
    if substance in COATED:
        side: Plugin = {"type": "plastic", "diffuse_reflectance": colour}
    else:
        side = {"type": "diffuse", "reflectance": colour}
    return {"type": "twosided", "side": side}


def shines(look: Look) -> Plugin:
    """What a mesh of a look gets beside its surface: an emitter if it is lit."""
    if look.emit <= 0.0:
        return {}
    return {"emitter": {"type": "area", "radiance": spectrum(look.emit * lamp(look.substance))}}


def textured(substance: Substance, albedo: Map, of: Mask) -> Plugin:
    """A surface whose brightness is a map over (v, u): a mix of its darkest and its brightest.

    Args:
        substance: which.
        albedo: the map.
        of: where on the map the substance is; elsewhere its albedo does not matter.
    """
    values = albedo[of] if of.any() else albedo
    low, high = float(values.min()), float(values.max())
    if high - low < 1e-6:
        return surface(substance, low)
    share = np.clip((albedo - low) / (high - low), 0.0, 1.0)
    return mixed(surface(substance, low), surface(substance, high), share)


def mixed(below: Plugin, above: Plugin, share: NDArray[Any]) -> Plugin:
    """Two surfaces, of which a map over (v, u) says how much of the upper one there is."""
    return {"type": "blendbsdf", "weight": _bitmap(share), "below": below, "zabove": above}


def _bitmap(values: NDArray[Any]) -> Plugin:
    """A map as it is, repeated along u and v; its first row is at v = 0."""
    rows = np.ascontiguousarray(values[:, :, None], np.float32)
    return {
        "type": "bitmap",
        "bitmap": engine().Bitmap(rows),
        "raw": True,
        "filter_type": "nearest",
        "wrap_mode": "repeat",
    }
