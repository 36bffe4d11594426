"""DVS-Voltmeter: a voltage that drifts and diffuses between two barriers.

Lin, Ma, Guo and Wen, "DVS-Voltmeter: Stochastic Process-Based Event Simulator for Dynamic Vision
Sensors", ECCV 2022.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numba import njit
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.simulators.base import Simulator, require_not_negative, require_positive
from eqs.simulators.ordering import Fired, event_key, with_room
from eqs.simulators.passage import chance_of_on, passage_time
from eqs.simulators.randomness import draw_key, mixed, uniform, uniform_map, word_at
from eqs.simulators.stream import Interval


@dataclass(frozen=True, kw_only=True)
class DVSVoltmeter(Simulator):
    """Fires at the first passages of a Brownian motion with drift through +1 and -1.

    Within an interval of mean grey level `L` and change `d`, the voltage drifts by
    `gain (d / dt) / (L + dark) + leak + light_leak L` and spreads by
    `photon_noise sqrt(L) / (L + dark) + thermal_noise` per square root of a microsecond, with
    levels 0..255. A pixel that fires starts again at 0. Contrast is thus counted on
    `ln(L + dark)`, with a threshold of `1 / gain`. The default values are those of a DVS346.

    In `fixed` mode pixels start at random phases of their leak. In `faithful` mode all start at 0,
    so that still pixels of equal light leak in step; without drift both barriers are equally
    likely from anywhere and passages take twice as long; passages against the drift are too short;
    times are rounded to the microsecond, not floored.

    Convention: as published, a side is drawn first and then a passage time of that barrier alone,
    and an interval without event moves the voltage along a line towards the side drawn.

    Args:
        contrast_gain: thresholds per natural-log unit, k1.
        dark_level: grey level added to the light, k2.
        photon_noise_per_sqrt_us: spread that falls with the light, k3.
        leak_per_us: drift in the dark, thresholds per microsecond, k4.
        light_leak_per_us: drift per grey level of light, k5.
        thermal_noise_per_sqrt_us: spread that does not depend on the light, k6.
        seed: of the motion.

    Raises:
        ValueError: gain or dark level is not positive, or another value is negative.

    Example:
        >>> frames = np.array([np.full((1, 1), level) for level in (90.0, 110.0)])
        >>> quiet = {"photon_noise_per_sqrt_us": 0, "thermal_noise_per_sqrt_us": 0}
        >>> ideal = DVSVoltmeter(contrast_gain=15, leak_per_us=0, light_leak_per_us=0, **quiet)
        >>> ideal.simulate(frames, [0, 50_000]).t.tolist()
        [20000, 40000]
    """

    name: ClassVar[str] = "dvs_voltmeter"
    version: ClassVar[int] = 2
    in_bands: ClassVar[bool] = True

    contrast_gain: float = 5.265
    dark_level: float = 20.0
    photon_noise_per_sqrt_us: float = 1e-4
    leak_per_us: float = 1e-7
    light_leak_per_us: float = 5e-9
    thermal_noise_per_sqrt_us: float = 1e-5
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the parameters."""
        super().__post_init__()
        require_positive(self, "contrast_gain", "dark_level")
        require_not_negative(
            self,
            "photon_noise_per_sqrt_us",
            "leak_per_us",
            "light_leak_per_us",
            "thermal_noise_per_sqrt_us",
        )

    @property
    def leaks(self) -> bool:
        """Whether a still pixel drifts."""
        return self.leak_per_us > 0 or self.light_leak_per_us > 0

    @property
    def stochastic(self) -> bool:
        """The motion and, in `fixed` mode, the phase of the leak are random."""
        spreads = self.photon_noise_per_sqrt_us > 0 or self.thermal_noise_per_sqrt_us > 0
        return spreads or (self.leaks and self.mode == "fixed")

    def begin(self, image: GreyImage, sequence: str) -> DVSVoltmeterPixels:
        """The pixels after the first frame."""
        return DVSVoltmeterPixels(self, image, sequence)


class DVSVoltmeterPixels:
    """The voltages of all pixels."""

    def __init__(self, model: DVSVoltmeter, image: GreyImage, sequence: str) -> None:
        """Start at the first image."""
        self.model = model
        self.sequence = sequence
        pixels = image.codes.size
        self.image = image
        self.voltage = np.zeros(pixels)
        if model.mode == "fixed" and model.leaks:
            # Drifting from 0 to 1 again and again, a pixel is as likely at one place as another.
            key = draw_key(model.seed, "leak phase", sequence, first_pixel=image.first_pixel)
            self.voltage = uniform_map(key, pixels)
        self.keys = np.empty(pixels, np.int64)

    def advance(self, image: GreyImage, interval: Interval) -> NDArray[np.int64]:
        """Events of one interval."""
        model = self.model
        self.keys, count = _fire(
            (self.image.codes, self.image.levels),
            (image.codes, image.levels),
            self.voltage,
            (model.contrast_gain, model.dark_level, model.leak_per_us, model.light_leak_per_us),
            (model.photon_noise_per_sqrt_us, model.thermal_noise_per_sqrt_us),
            model.mode == "faithful",
            draw_key(
                model.seed,
                "motion",
                self.sequence,
                str(interval.frame),
                first_pixel=image.first_pixel,
            ),
            interval.start_us,
            interval.span_us,
            self.keys,
        )
        self.image = image
        return self.keys[:count]


@njit(cache=True, nogil=True)
def _fire(
    start: tuple[NDArray[Any], NDArray[np.float64]],
    end: tuple[NDArray[Any], NDArray[np.float64]],
    voltage: NDArray[np.float64],
    drifts: tuple[float, float, float, float],
    spreads: tuple[float, float],
    faithful: bool,
    frame_key: np.uint64,
    start_us: int,
    span_us: int,
    keys: NDArray[np.int64],
) -> Fired:
    gain, dark, leak, light_leak = drifts
    gain_per_us = gain / span_us
    rounding = 0.5 if faithful else 0.0
    count = 0
    for pixel in range(voltage.size):
        first, last = start[1][start[0][pixel]], end[1][end[0][pixel]]
        light = 0.5 * (first + last)
        relative = 1.0 / (light + dark)
        drift = gain_per_us * (last - first) * relative + leak + light_leak * light
        spread = spreads[0] * math.sqrt(light) * relative + spreads[1]
        level, elapsed_us = voltage[pixel], 0.0
        word = word_at(frame_key, pixel)
        while True:
            chance = chance_of_on(level, drift, spread, faithful)
            up = chance == 1.0 or uniform(word_at(word, 0)) < chance
            distance = 1.0 - level if up else 1.0 + level
            towards = drift if up else -drift
            wait_us = passage_time(distance, towards, spread, word, faithful)
            if elapsed_us + wait_us >= span_us:
                moved = distance * (span_us - elapsed_us) / wait_us
                voltage[pixel] = level + moved if up else level - moved
                break
            elapsed_us += wait_us
            keys = with_room(keys, count + 1)
            keys[count] = event_key(start_us + int(elapsed_us + rounding), pixel, 1 if up else 0)
            level = 0.0
            word = mixed(word)
            count += 1
    return keys, count
