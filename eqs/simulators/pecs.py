"""PECS: light as a photodiode sees it, in front of the circuit of ICNS.

Han, Lyu, Li, Wei, Li, Wei, Chen and Ji, "Physical-Based Event Camera Simulator", ECCV 2024. Its
authors take the circuit from ICNS; what they add is the way of the light through lens, spectrum and
quantum efficiency.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from eqs.frames import Light, LightSource
from eqs.simulators.icns import ICNS, ICNSPixels

PHOTODIODE = Light(weights="photodiode")


@dataclass(frozen=True, kw_only=True)
class PECS(ICNS):
    """ICNS's pixel on photocurrent; see there for the circuit and its parameters.

    Frames are linear light by default: the curve of sRGB is undone, and of colours the photodiode's
    share is taken, so that edges between colours of equal luma fire. Spectra become frames of
    photocurrent by `eqs.frames.photocurrent`; frames of photocurrent or of light, as a renderer
    gives them, take `light=None`. What a lens does to flat images is `lens`; defocus and ghosts
    need a scene, as that of `eqs render scene=traced`.

    In place of the program's logarithm, which skips dark pixels, the circuit sees `ln(i + 1)` of a
    photocurrent of 0 to 255, so that 1 acts as dark current, and its time constant is inversely
    proportional to that at all times; there is no faithful mode.

    Args:
        time_constant_us: of the photoreceptor at a photocurrent of 1000; 76.8 is 300 us at white.
        white_lux: photocurrent of level 255.

    Raises:
        ValueError: mode is faithful; or as for ICNS.

    Example:
        >>> import numpy as np
        >>> equal_luma = np.uint8([[[[0, 0, 255]]], [[[97, 0, 0]]]])
        >>> quiet = PECS(background_on_hz=0, background_off_hz=0)
        >>> len(quiet.simulate(equal_luma, [0, 50_000]))
        7
    """

    name: ClassVar[str] = "pecs"
    pixels: ClassVar = {"fixed": ICNSPixels}
    version: ClassVar[int] = 1
    rounds_luma: ClassVar[bool] = False

    threshold_on_log: float = 0.3
    threshold_off_log: float = 0.3
    latency_us: float = 10.0
    time_constant_us: float = 76.8
    background_off_hz: float = 0.1
    background_spread_decades: float = 1.0
    white_lux: float = 255.0
    light: LightSource | None = PHOTODIODE
