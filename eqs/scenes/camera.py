"""The frame camera beside the event camera: exposure, noise, tone curve, eight bits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.float32]
SUB_EXPOSURE_US = 2000
METERED_SHARE = 85.0  # percentile of the light that auto-exposure looks at
METERED_LINEAR = 0.55  # and what it makes of it, in linear light


def tone_curve(linear: NDArray[np.floating]) -> NDArray[np.float64]:
    """Display value in [0, 1] of linear light in [0, 1].

    Source: IEC 61966-2-1 (sRGB).

    Example:
        >>> tone_curve(np.array([0.0, 0.18, 1.0])).round(3).tolist()
        [0.0, 0.461, 1.0]
    """
    clipped = np.clip(linear, 0.0, 1.0).astype(np.float64)
    shown: NDArray[np.float64] = np.where(
        clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1.0 / 2.4) - 0.055
    )
    return shown


@dataclass(frozen=True, kw_only=True)
class Exposure:
    """What auto-exposure chose for one recording.

    Args:
        time_us: exposure time.
        white_lux: mean light over the exposure that saturates a pixel.
        electrons: photo-electrons at saturation.
    """

    time_us: int
    white_lux: float
    electrons: float


@dataclass(frozen=True, kw_only=True)
class FrameCamera:
    """A global-shutter camera with one exposure per recording.

    By day the exposure adapts to the light; where it would exceed `longest_us` it stays there,
    as on DSEC's night recordings, and gain makes up for the missing light at the price of noise.

    Args:
        shortest_us: shortest exposure.
        longest_us: longest exposure, DSEC's ceiling rounded to 0.1 ms.
        lux_ms_at_white: exposure, lux at the focal plane times ms, that fills a pixel.
        full_well: electrons of a full pixel.
        read_noise_electrons: standard deviation of the readout.
    """

    shortest_us: int = 200
    longest_us: int = 15_000
    lux_ms_at_white: float = 400.0
    full_well: float = 10_000.0
    read_noise_electrons: float = 4.0

    def meter(self, picture: Picture) -> Exposure:
        """Choose the exposure that renders the brighter part of the scene well below white."""
        white_lux = max(float(np.percentile(picture, METERED_SHARE)), 1e-3) / METERED_LINEAR
        wanted_us = 1e3 * self.lux_ms_at_white / white_lux
        time_us = int(np.clip(wanted_us, self.shortest_us, self.longest_us)) // 2 * 2
        share = min(1.0, time_us / wanted_us)
        return Exposure(time_us=time_us, white_lux=white_lux, electrons=self.full_well * share)

    def expose(
        self,
        radiance: Callable[[float], Picture],
        middle_us: int,
        exposure: Exposure,
        noise_key: tuple[int, ...],
    ) -> NDArray[np.uint8]:
        """One frame (H, W): mean light over the exposure centred on `middle_us`, then noise.

        Args:
            radiance: light in lux at a time in microseconds.
            middle_us: middle of the exposure.
            exposure: what `meter` chose.
            noise_key: integers that name the recording and the frame.
        """
        count = max(2, round(exposure.time_us / SUB_EXPOSURE_US))
        start = middle_us - 0.5 * exposure.time_us
        light = np.mean(
            [radiance(start + (k + 0.5) * exposure.time_us / count) for k in range(count)], axis=0
        )
        rng = np.random.default_rng(np.random.SeedSequence(noise_key))
        electrons = light / exposure.white_lux * exposure.electrons
        noise = np.sqrt(np.minimum(electrons, exposure.electrons) + self.read_noise_electrons**2)
        electrons = electrons + noise * rng.standard_normal(light.shape)
        return np.rint(255.0 * tone_curve(electrons / exposure.electrons)).astype(np.uint8)
