"""The pixels of DVS-Voltmeter, whose voltages wander between two barriers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.simulators.dvs_voltmeter.parameters import DVSVoltmeter
from eqs.simulators.dvs_voltmeter.voltage import Motion, fire, move_quiet
from eqs.simulators.pixel.randomness import draw_key, uniform_map
from eqs.simulators.streaming.pixels import Interval


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
        self.motion = Motion(
            float(model.contrast_gain),
            float(model.dark_level),
            float(model.leak_per_us),
            float(model.light_leak_per_us),
            float(model.photon_noise_per_sqrt_us),
            float(model.thermal_noise_per_sqrt_us),
        )
        self.chosen = np.arange(pixels, dtype=np.int32)
        self.keys = np.empty(pixels, np.int64)

    def advance(self, image: GreyImage, interval: Interval) -> NDArray[np.int64]:
        """Events of one interval."""
        faithful, left = self.model.mode == "faithful", image.codes.size
        seen = (self.image.codes, self.image.levels), (image.codes, image.levels)
        key = draw_key(
            self.model.seed,
            "motion",
            self.sequence,
            str(interval.frame),
            first_pixel=image.first_pixel,
        )
        span_us = interval.span_us
        if not faithful:
            left = move_quiet(*seen, self.voltage, self.motion, key, span_us, self.chosen)
        self.keys, count = fire(
            self.chosen[:left],
            *seen,
            self.voltage,
            self.motion,
            faithful,
            key,
            interval.start_us,
            span_us,
            self.keys,
        )
        self.image = image
        return self.keys[:count]
