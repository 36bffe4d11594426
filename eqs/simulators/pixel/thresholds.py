"""Thresholds that differ from pixel to pixel."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.kernels import njit
from eqs.simulators.pixel.randomness import draw_key, normal, normal_map

SMALLEST_THRESHOLD_LOG = 0.01


class Sides(NamedTuple):
    """Something that every pixel has once for ON and once for OFF, shape (pixels,) each."""

    on: NDArray[np.float64]
    off: NDArray[np.float64]


class Thresholded(Protocol):
    """A simulator whose pixels differ in their thresholds."""

    @property
    def threshold_on_log(self) -> float: ...  # noqa: D102

    @property
    def threshold_off_log(self) -> float: ...  # noqa: D102

    @property
    def threshold_sigma_log(self) -> float: ...  # noqa: D102

    @property
    def seed(self) -> int: ...  # noqa: D102


class ThresholdLaw(NamedTuple):
    """What thresholds are drawn from anew: their means, OFF as a positive number, and spread."""

    on_log: float
    off_log: float
    sigma_log: float


def threshold_map(
    mean_log: float, sigma_log: float, seed: int, name: str, image: GreyImage
) -> NDArray[np.float64]:
    """A threshold for every pixel of an image, normally distributed and at least 0.01.

    The map belongs to the sensor: it depends on the seed and the name alone. Without spread it
    takes no memory, being one number seen many times.

    Example:
        >>> image = GreyImage.from_frame(np.zeros((1, 3)))
        >>> threshold_map(0.2, 0.0, seed=0, name="on", image=image).tolist()
        [0.2, 0.2, 0.2]
    """
    pixels = image.codes.size
    if sigma_log == 0:
        return np.broadcast_to(np.float64(mean_log), (pixels,))
    key = draw_key(seed, name, first_pixel=image.first_pixel)
    drawn = mean_log + sigma_log * normal_map(key, pixels)
    return np.maximum(drawn, SMALLEST_THRESHOLD_LOG)


def threshold_maps(model: Thresholded, image: GreyImage) -> Sides:
    """The thresholds of every pixel of an image, ON and OFF, see `threshold_map`."""
    sigma, seed = model.threshold_sigma_log, model.seed
    return Sides(
        threshold_map(model.threshold_on_log, sigma, seed, "threshold on", image),
        threshold_map(model.threshold_off_log, sigma, seed, "threshold off", image),
    )


@njit(cache=True)
def redraw(
    thresholds: NDArray[np.float64],
    pixel: int,
    mean_log: float,
    sigma_log: float,
    smallest_log: float,
    word: np.uint64,
) -> None:
    """Draw a pixel's threshold anew, as after an event; nothing happens without spread."""
    if sigma_log > 0.0:
        thresholds[pixel] = max(mean_log + sigma_log * normal(word), smallest_log)
