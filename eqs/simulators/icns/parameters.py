"""ICNS: a pixel with latency, jitter and a time constant that shrinks with the light.

Joubert, Marcireau, Ralph, Jolley, van Schaik and Cohen, "Event Camera Simulator Improvements via
Characterized Parameters", Frontiers in Neuroscience 2021; its Python program IEBCS.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.simulators.base import Simulator, require_not_negative, require_positive
from eqs.simulators.pixel.noise import rate_map


@dataclass(frozen=True, kw_only=True)
class ICNS(Simulator):
    """A photoreceptor follows `ln(E + 1)` of the illuminance with a time constant `tau 1000 / E`.

    A pixel fires once its voltage has left that of its last reset by a threshold, which is drawn
    anew after each event. The event follows after a normally distributed latency between 0 and
    10 ms, whose spread holds the jitter and the threshold noise over the voltage's slope, and may
    thus come after the next frame. When the refractory period ends, the pixel is reset to the
    voltage it then has. Background events come at given rates.

    In `fixed` mode the logarithm is linear between frames and the voltage follows it exactly, with
    the time constant of the interval's geometric mean; background events form a Poisson process and
    start a refractory period as all events do. In `faithful` mode each image acts from the frame
    before on as a step, so that at video rates a bright pixel fires once per frame whatever the
    contrast, too early by a frame; background events have a fixed period and at most one per
    polarity and frame, wipe out the signal of their frame, and ignore the refractory period; black
    pixels stand still and see a target of zero.

    Convention: frames are taken as proportional to illuminance, white being `white_lux`.

    Args:
        threshold_on_log: mean contrast of an ON event, natural-log units.
        threshold_off_log: mean contrast of an OFF event, as a positive number.
        threshold_sigma_log: standard deviation of both from event to event.
        latency_us: mean delay of an event after its crossing.
        jitter_us: standard deviation of that delay.
        refractory_us: refractory period: no event for so long after one.
        time_constant_us: of the photoreceptor at 1000 lux.
        background_on_hz: background ON events per second of a pixel.
        background_off_hz: the same for OFF.
        background_spread_decades: standard deviation of the decimal logarithm of both between
            pixels, which leaves their means.
        white_lux: illuminance of grey level 255.
        seed: of thresholds, latencies and background.

    Raises:
        ValueError: a threshold, time constant or illuminance is not positive, or another value is
            negative.

    Example:
        >>> frames = np.array([np.full((1, 1), level) for level in (64.0, 128.0)])
        >>> quiet = {"background_on_hz": 0, "background_off_hz": 0, "threshold_sigma_log": 0}
        >>> fast = ICNS(threshold_on_log=0.2, latency_us=0, jitter_us=0, refractory_us=0, **quiet)
        >>> fast.simulate(frames, [0, 70_000]).t.tolist()
        [20214, 40418, 60621]
    """

    name: ClassVar[str] = "icns"
    version: ClassVar[int] = 2
    in_bands: ClassVar[bool] = True

    threshold_on_log: float = 0.4
    threshold_off_log: float = 0.4
    threshold_sigma_log: float = 0.01
    latency_us: float = 100.0
    jitter_us: float = 10.0
    refractory_us: float = 100.0
    time_constant_us: float = 40.0
    background_on_hz: float = 0.1
    background_off_hz: float = 0.01
    background_spread_decades: float = 0.0
    white_lux: float = 1e4
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the parameters."""
        super().__post_init__()
        require_positive(
            self, "threshold_on_log", "threshold_off_log", "time_constant_us", "white_lux"
        )
        require_not_negative(
            self,
            "threshold_sigma_log",
            "latency_us",
            "jitter_us",
            "refractory_us",
            "background_on_hz",
            "background_off_hz",
            "background_spread_decades",
        )

    @property
    def stochastic(self) -> bool:
        """Thresholds, latencies and background events are random."""
        background = self.background_on_hz > 0 or self.background_off_hz > 0
        return background or self.threshold_sigma_log > 0 or self.jitter_us > 0

    def signal(self, levels: NDArray[np.float64]) -> NDArray[np.float64]:
        """Natural log of the illuminance plus one lux, at grey levels 0..255."""
        return np.log1p(levels * self.white_lux / 255.0)

    def background_hz(self, image: GreyImage) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Background ON and OFF events per second of every pixel."""
        spread, seed = self.background_spread_decades, self.seed
        return (
            rate_map(self.background_on_hz, spread, seed, "background on", image),
            rate_map(self.background_off_hz, spread, seed, "background off", image),
        )
