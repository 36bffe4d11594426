"""Shot noise: events that the scene did not cause."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.kernels import njit
from eqs.simulators.pixel.photoreceptor import MICROSECONDS, relative_light
from eqs.simulators.pixel.randomness import draw_key, normal_map, poisson, uniform, word_at
from eqs.simulators.streaming.keys import event_key

_RUN = 64  # pixels that are ruled out together


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
def noisy_pixels(
    codes: NDArray[Any],
    shot: NDArray[np.float64],
    on: NDArray[np.float64],
    off: NDArray[np.float64],
    nominal: tuple[float, float],
    least: tuple[float, float],
    noise_key: np.uint64,
    chosen: NDArray[np.int32],
    numbers: NDArray[np.int64],
) -> tuple[int, int]:
    """List the pixels that fire noise, and Poisson numbers of events for them.

    Args:
        codes: index into `shot` of each pixel.
        shot: expected events of one polarity at the nominal threshold, for each code.
        on: threshold of each pixel.
        off: the same for OFF, positive.
        nominal: mean thresholds; noise is inversely proportional to a pixel's own.
        least: smallest thresholds of the sensor.
        noise_key: family of draws of this frame.
        chosen: filled with the pixels, in rising order; a place for each.
        numbers: filled with their numbers of events; as long as `chosen`.

    Returns:
        How many pixels are listed, and how many events they fire in all.
    """
    # No pixel expects more than this, so nearly all are known to be silent by their draw alone.
    most = shot.max()
    quiet = 1.0 - (most * nominal[0] / least[0] + most * nominal[1] / least[1])
    candidates = 0
    for first in range(0, codes.size, _RUN):
        run = range(first, min(first + _RUN, codes.size))
        largest = np.uint64(0)
        for pixel in run:
            largest = max(largest, word_at(noise_key, pixel))
        if uniform(largest) <= quiet:
            continue
        for pixel in run:
            chosen[candidates] = pixel
            candidates += int(uniform(word_at(noise_key, pixel)) > quiet)
    count = total = 0
    for pixel in chosen[:candidates]:
        expected = sum(_expected(pixel, codes, shot, on, off, nominal))
        number = poisson(word_at(noise_key, pixel), expected)
        chosen[count], numbers[count] = pixel, number
        count += int(number > 0)
        total += number
    return count, total


@njit(cache=True)
def _expected(
    pixel: int,
    codes: NDArray[Any],
    shot: NDArray[np.float64],
    on: NDArray[np.float64],
    off: NDArray[np.float64],
    nominal: tuple[float, float],
) -> tuple[float, float]:
    """Expected ON and OFF noise events of a pixel."""
    one = shot[codes[pixel]]
    return one * nominal[0] / on[pixel], one * nominal[1] / off[pixel]


@njit(cache=True, nogil=True)
def scatter_noise(
    chosen: NDArray[np.int32],
    numbers: NDArray[np.int64],
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
) -> None:
    """Fire the noise of `noisy_pixels` at random times; such pixels forget pending contrast.

    Args:
        chosen: the pixels that fire.
        numbers: how many events each.
        codes: index into `shot` of each pixel.
        shot: expected events of one polarity at the nominal threshold, for each code.
        above: signal above reference of each pixel; 0 where noise fired.
        on: threshold of each pixel.
        off: the same for OFF, positive.
        nominal: mean thresholds.
        noise_key: family of draws of this frame.
        start_us: start of the interval.
        span_us: its length.
        keys: filled with the events.
    """
    count = 0
    for index in range(chosen.size):
        pixel = chosen[index]
        above[pixel] = 0.0
        expected_on, expected_off = _expected(pixel, codes, shot, on, off, nominal)
        on_share = expected_on / (expected_on + expected_off)
        word = word_at(noise_key, pixel)
        for ordinal in range(numbers[index]):
            time_us = start_us + int(uniform(word_at(word, 2 * ordinal)) * span_us)
            polarity = 1 if uniform(word_at(word, 2 * ordinal + 1)) < on_share else 0
            keys[count] = event_key(time_us, pixel, polarity)
            count += 1
