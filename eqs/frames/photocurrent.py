"""Spectra become grey by the camera's quantum efficiency: what of the light turns into current.

Source of the efficiency: the table that PECS (Han et al., ECCV 2024) gives its camera.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

SHORTEST_NM: Final = 400.0
LONGEST_NM: Final = 700.0
# Relative to the best wavelength, every 10 nm from 400 to 700.
QUANTUM_EFFICIENCY: Final = (
    0.82, 0.85, 0.87, 0.88, 0.92, 0.95, 0.96, 0.96, 0.98, 1.0, 0.99, 1.0, 0.99, 1.0, 0.99, 1.0,
    0.99, 0.98, 0.98, 0.97, 0.95, 0.94, 0.92, 0.92, 0.87, 0.86, 0.85, 0.82, 0.79, 0.78, 0.76,
)  # fmt: skip


def photocurrent(
    radiance: NDArray[np.floating],
    wavelengths_nm: ArrayLike,
    efficiency: Sequence[float] = QUANTUM_EFFICIENCY,
) -> NDArray[Any]:
    """Mean over the bands of radiance times efficiency: grey frames for any simulator.

    Convention: as published, the mean is not divided by that of the efficiency, so a spectrum that
    is flat at L becomes L times `flat_response`; give simulators `white` times that.

    Args:
        radiance: spectral radiance in the middle of each band, floating, shape (N, H, W, B) or
            any other that ends in the bands.
        wavelengths_nm: middle of each band, increasing in equal steps within 400..700, shape (B,).
        efficiency: in equal steps from 400 to 700 nm, linear in between.

    Returns:
        Photocurrents in the unit and the floating type of the radiance, shape (N, H, W).

    Raises:
        ValueError: bands and wavelengths differ in number, or those are not as said.

    Example:
        >>> light = np.ones((1, 1, 2, 4))
        >>> photocurrent(light, [400, 500, 600, 700]).round(2).tolist()
        [[[0.88, 0.88]]]
    """
    weights = band_efficiency(wavelengths_nm, efficiency) / np.size(wavelengths_nm)
    spectra = np.asarray(radiance)
    if spectra.dtype.kind != "f" or spectra.shape[-1:] != weights.shape:
        raise ValueError(
            f"Expected floating radiance with {len(weights)} bands along the last axis, got "
            f"{spectra.dtype} shaped {spectra.shape}; set wavelengths_nm to one for each band"
        )
    current: NDArray[Any] = spectra @ weights.astype(spectra.dtype)
    return current


def flat_response(
    wavelengths_nm: ArrayLike, efficiency: Sequence[float] = QUANTUM_EFFICIENCY
) -> float:
    """Photocurrent of a spectrum that is flat at one, sampled at these bands.

    Example:
        >>> round(flat_response(np.linspace(400, 700, 31)), 4)
        0.9206
    """
    return float(band_efficiency(wavelengths_nm, efficiency).mean())


def band_efficiency(
    wavelengths_nm: ArrayLike, efficiency: Sequence[float] = QUANTUM_EFFICIENCY
) -> NDArray[np.float64]:
    """The efficiency at the middle of each band, shape (B,).

    Raises:
        ValueError: the wavelengths do not increase in equal steps within 400..700 nm, or an
            efficiency is negative or none is above zero.
    """
    middles, table = np.asarray(wavelengths_nm, np.float64), np.asarray(efficiency, np.float64)
    steps = np.diff(middles)
    even = middles.ndim == 1 and middles.size > 0 and np.allclose(steps, steps[:1], rtol=1e-6)
    if not even or (steps <= 0).any() or not _within(middles):
        raise ValueError(
            f"Expected wavelengths that increase in equal steps from {SHORTEST_NM:g} to "
            f"{LONGEST_NM:g} nm, got {np.array2string(middles, threshold=8)}; set wavelengths_nm"
        )
    if table.ndim != 1 or table.size < 2 or not (table >= 0).all() or not table.any():
        raise ValueError(
            f"Expected efficiencies of zero or more from {SHORTEST_NM:g} to {LONGEST_NM:g} nm, "
            f"got {np.array2string(table, threshold=8)}; set efficiency"
        )
    return np.interp(middles, np.linspace(SHORTEST_NM, LONGEST_NM, table.size), table)


def _within(middles: NDArray[np.float64]) -> bool:
    return bool((middles >= SHORTEST_NM).all() and (middles <= LONGEST_NM).all())
