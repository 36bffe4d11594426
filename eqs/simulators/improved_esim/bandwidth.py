"""The low-pass of a pixel's circuit: photoreceptor, source follower, differencing amplifier.

Low and Lee, "Deblur e-NeRF: NeRF from Motion-Blurred Events under High-speed or Low-light
Conditions", ECCV 2024.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.kernels import njit
from eqs.simulators.improved_esim.parameters import ImprovedESIM
from eqs.simulators.pixel.ramp_response import response

SMALLEST_CURRENT_FA = 1e-9
_APART = 1e-7
"""Least relative distance of the two decay rates, whose difference divides."""


class Photoreceptor(NamedTuple):
    """The equation `y'' + damping y' + stiffness y = stiffness u`, for each grey level, per us."""

    damping: NDArray[np.float64]
    stiffness: NDArray[np.float64]

    @classmethod
    def at(cls, model: ImprovedESIM, levels: NDArray[np.float64]) -> Photoreceptor:
        """The equation linearised at grey levels 0..255."""
        current_fa = np.maximum(model.current_fa(levels), SMALLEST_CURRENT_FA)
        # Femtofarad times millivolt over femtoampere are milliseconds.
        input_us = 1e3 * model.photodiode_ff * model.thermal_voltage_mv / current_fa
        miller_us = 1e3 * model.miller_ff * model.thermal_voltage_mv / current_fa
        output_us = model.output_time_constant_us
        product = (input_us + miller_us) * output_us
        total = input_us + miller_us + model.amplifier_gain * miller_us + output_us
        loop_gain = model.back_gate * model.amplifier_gain
        return cls(total / product, (loop_gain + 1.0) / product)

    def free_motion(self, span_us: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Deviation from rest after a span that began with (1, 0), and one with (0, 1)."""
        half = 0.5 * self.damping
        root = np.sqrt((half * half - self.stiffness).astype(complex))
        root = np.where(np.abs(root) < _APART * half, _APART * half, root)
        slow, fast = np.exp((root - half) * span_us), np.exp((-root - half) * span_us)
        kicked = (slow - fast) / (2.0 * root)
        displaced = 0.5 * (slow + fast) + half * kicked
        return displaced.real, kicked.real


class PixelFilter:
    """The filtered signal of all pixels, exact for inputs that are linear between frames."""

    def __init__(self, model: ImprovedESIM, image: GreyImage) -> None:
        """Settle on the first image."""
        self.model = model
        self.input = model.signal(image.levels)[image.codes]
        self.received = self.input.copy()
        self.speed = np.zeros_like(self.input)
        self.followed = self.input.copy()
        self.output = self.input.copy()

    def advance(self, image: GreyImage, span_us: int) -> NDArray[np.float64]:
        """The output after the interval that ends with an image."""
        model = self.model
        target: NDArray[np.float64] = model.signal(image.levels)[image.codes]
        if model.order == 0:
            self.input = self.output = target
            return target
        equation = Photoreceptor.at(model, image.levels)
        displaced, kicked = equation.free_motion(span_us)
        received = np.empty_like(target)
        _receive(
            image.codes,
            (self.input, target),
            (equation.damping, equation.stiffness),
            (displaced, kicked),
            self.received,
            self.speed,
            received,
            float(span_us),
        )
        followed, output = received, received
        if model.order > 2:
            followed = output = self.followed.copy()
            _follow(
                self.received, received, followed, _time_constant(model.source_follower_hz), span_us
            )
        if model.order > 3:
            output = self.output.copy()
            _follow(self.followed, followed, output, _time_constant(model.amplifier_hz), span_us)
        self.input, self.received, self.followed, self.output = target, received, followed, output
        return output


def _time_constant(cutoff_hz: float) -> float:
    """Microseconds of a first-order stage."""
    return 1e6 / (2.0 * math.pi * cutoff_hz)


@njit(cache=True, nogil=True)
def _receive(
    codes: NDArray[Any],
    light: tuple[NDArray[np.float64], NDArray[np.float64]],
    equation: tuple[NDArray[np.float64], NDArray[np.float64]],
    free_motion: tuple[NDArray[np.float64], NDArray[np.float64]],
    received: NDArray[np.float64],
    speed: NDArray[np.float64],
    after: NDArray[np.float64],
    span_us: float,
) -> None:
    """The photoreceptor: it lags a ramp by a constant, and decays freely towards that."""
    for pixel in range(codes.size):
        code = codes[pixel]
        damping, stiffness = equation[0][code], equation[1][code]
        displaced, kicked = free_motion[0][code], free_motion[1][code]
        slope = (light[1][pixel] - light[0][pixel]) / span_us
        lag = damping / stiffness * slope
        away = received[pixel] - (light[0][pixel] - lag)
        faster = speed[pixel] - slope
        after[pixel] = light[1][pixel] - lag + displaced * away + kicked * faster
        speed[pixel] = slope - stiffness * kicked * away + (displaced - damping * kicked) * faster


@njit(cache=True, nogil=True)
def _follow(
    before: NDArray[np.float64],
    after: NDArray[np.float64],
    follower: NDArray[np.float64],
    tau_us: float,
    span_us: int,
) -> None:
    """A first-order stage whose input moves along a line from `before` to `after`."""
    for pixel in range(before.size):
        slope = (after[pixel] - before[pixel]) / span_us
        follower[pixel] = response(follower[pixel], before[pixel], slope, tau_us, float(span_us))
