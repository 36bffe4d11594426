"""How a pixel maps grey levels to the signal that it compares."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray


def log_intensity(levels: NDArray[np.float64], offset: float) -> NDArray[np.float64]:
    """Natural log of the intensity, 0..1, above an offset that keeps black finite.

    Example:
        >>> log_intensity(np.array([0.0, 255.0]), offset=1e-3).round(3).tolist()
        [-6.908, 0.001]
    """
    return np.log(offset + levels / 255.0)


def lin_log(levels: NDArray[np.float64], knee_level: float = 20.0) -> NDArray[np.float64]:
    """Natural log of the grey level, and a line to the origin below the knee.

    Rounded to 8 decimals, so that equal steps up and down cancel.

    Example:
        >>> lin_log(np.array([0.0, 10.0, 20.0, 200.0])).round(3).tolist()
        [0.0, 1.498, 2.996, 5.298]
    """
    slope = math.log(knee_level) / knee_level
    logarithm = np.log(np.maximum(levels, knee_level))
    signal: NDArray[np.float64] = np.where(levels <= knee_level, levels * slope, logarithm)
    return np.round(signal, 8)


def relative_light(levels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Light as a share of full light, never below the 7 % that v2e gives to black.

    Example:
        >>> float(relative_light(np.array([255.0]))[0])
        1.0
    """
    return (levels + 20.0) / 275.0
