"""Shot noise: events that the scene did not cause."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.simulators.ordering import Fired, event_key, with_room
from eqs.simulators.photoreceptor import MICROSECONDS, relative_light
from eqs.simulators.randomness import draw_key, normal_map, poisson, uniform, word_at


def shot_events(
    levels: NDArray[np.float64], shot_noise_hz: float, span_us: int
) -> NDArray[np.float64]:
    """Expected shot-noise events of one polarity within an interval, fewest in full light.

    Example:
        >>> shot_events(np.array([255.0]), shot_noise_hz=8.0, span_us=1_000_000).tolist()
        [1.0]
    """
    full = 0.5 * shot_noise_hz * span_us * MICROSECONDS
    return full * (1.0 - 0.75 * relative_light(levels))


def rate_map(
    rate_hz: float, spread_decades: float, seed: int, name: str, image: GreyImage
) -> NDArray[np.float64]:
    """A rate for every pixel of an image, log-normally distributed about a given mean.

    Measured background is of this kind: most pixels are nearly silent, and a few make most of it.
    Without spread the map takes no memory, being one number seen many times.

    Example:
        >>> image = GreyImage.from_frame(np.zeros((1, 3)))
        >>> rate_map(0.1, 0.0, seed=0, name="on", image=image).tolist()
        [0.1, 0.1, 0.1]
    """
    pixels = image.codes.size
    if rate_hz == 0 or spread_decades == 0:
        return np.broadcast_to(np.float64(rate_hz), (pixels,))
    spread = math.log(10.0) * spread_decades
    drawn = normal_map(draw_key(seed, name, first_pixel=image.first_pixel), pixels)
    rates: NDArray[np.float64] = rate_hz * np.exp(spread * drawn - 0.5 * spread * spread)
    return rates


@njit(cache=True, nogil=True)
def scatter_noise(
    codes: NDArray[Any],
    shot: NDArray[np.float64],
    above: NDArray[np.float64],
    on: NDArray[np.float64],
    off: NDArray[np.float64],
    nominal: tuple[float, float],
    noise_key: np.uint64,
    start_us: int,
    span_us: int,
    keys: NDArray[np.int64],
    count: int,
) -> Fired:
    """Fire Poisson numbers of noise events at random times; such pixels forget pending contrast.

    Args:
        codes: index into `shot` of each pixel.
        shot: expected events of one polarity at the nominal threshold, for each code.
        above: signal above reference of each pixel; 0 where noise fired.
        on: threshold of each pixel.
        off: the same for OFF, positive.
        nominal: mean thresholds; noise is inversely proportional to a pixel's own.
        noise_key: family of draws of this frame.
        start_us: start of the interval.
        span_us: its length.
        keys: buffer for the events.
        count: how many events it holds already.
    """
    for pixel in range(codes.size):
        expected_on = shot[codes[pixel]] * nominal[0] / on[pixel]
        expected_off = shot[codes[pixel]] * nominal[1] / off[pixel]
        word = word_at(noise_key, pixel)
        number = poisson(word, expected_on + expected_off)
        if number == 0:
            continue
        above[pixel] = 0.0
        on_share = expected_on / (expected_on + expected_off)
        keys = with_room(keys, count + number)
        for ordinal in range(number):
            time_us = start_us + int(uniform(word_at(word, 2 * ordinal)) * span_us)
            polarity = 1 if uniform(word_at(word, 2 * ordinal + 1)) < on_share else 0
            keys[count] = event_key(time_us, pixel, polarity)
            count += 1
    return keys, count
