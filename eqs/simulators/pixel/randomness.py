"""Random numbers that depend on where they are used, never on when.

Every draw is a hash of (seed, name, frame, pixel), so chunking, order and process count cannot
change it. The hash is SplitMix64 (Steele, Lea and Flood, OOPSLA 2014): a counter that advances by
the golden ratio, passed through a 64-bit finaliser.
"""

from __future__ import annotations

import hashlib
import math
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from eqs.kernels import njit
from eqs.processors import useful_bands

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_FIRST = np.uint64(0xBF58476D1CE4E5B9)
_SECOND = np.uint64(0x94D049BB133111EB)
_LOW = np.uint64(0xFFFFFFFF)
_S30, _S27, _S31, _S32, _S11 = (np.uint64(shift) for shift in (30, 27, 31, 32, 11))
_QUANTILE_MASK = np.uint64(2047)
_LARGEST_POISSON = 10_000
_LAYER_MASK, _NEXT = np.uint64(127), np.uint64(1)
_LAST_LAYER, _LAYER_AREA = 3.442619855899, 9.91256303526217e-3  # of 128 layers


def _normal_quantiles(count: int) -> NDArray[np.float64]:
    """The middle quantiles of `count` equal parts of a normal distribution, of unit variance."""
    middles = (np.arange(count) + 0.5) / count
    values = np.array([NormalDist().inv_cdf(middle) for middle in middles])
    return values / values.std()


NORMAL_QUANTILES = _normal_quantiles(2048)


def _layers(count: int) -> NDArray[np.float64]:
    """Right ends of layers of equal area under exp(-x**2 / 2), the lowest with the tail."""
    density = math.exp(-0.5 * _LAST_LAYER**2)
    ends = [_LAYER_AREA / density, _LAST_LAYER]
    while len(ends) < count:
        density += _LAYER_AREA / ends[-1]
        ends.append(math.sqrt(-2.0 * math.log(density)))
    return np.array([*ends, 0.0])


ZIGGURAT = _layers(128)


def draw_key(seed: int, *names: str, first_pixel: int = 0) -> np.uint64:
    """The key of one family of draws, from the seed and what the draws are for.

    Args:
        seed: of the simulator.
        names: what the draws are for.
        first_pixel: which pixel of the sensor draws number 0, in a part of the sensor.

    Example:
        >>> len({draw_key(0, "leak"), draw_key(1, "leak"), draw_key(0, "shot")})
        3
    """
    text = "\0".join((str(int(seed)), *names))
    digest = hashlib.blake2b(text.encode(), digest_size=8).digest()
    key = int.from_bytes(digest, "little") + first_pixel * int(_GOLDEN)
    return np.uint64(key % 2**64)


@njit(cache=True)
def mixed(word: np.uint64) -> np.uint64:
    """Scramble 64 bits so that neighbouring words become unrelated."""
    word = (word ^ (word >> _S30)) * _FIRST
    word = (word ^ (word >> _S27)) * _SECOND
    return word ^ (word >> _S31)


@njit(cache=True)
def word_at(key: np.uint64, index: int) -> np.uint64:
    """64 random bits number `index` of the family `key`; also the key of a sub-family."""
    return mixed(key + (np.uint64(index) + np.uint64(1)) * _GOLDEN)


@njit(cache=True)
def uniform(word: np.uint64) -> float:
    """A number in [0, 1) from 64 random bits."""
    return np.float64(word >> _S11) * 2.0**-53


@njit(cache=True)
def normal(word: np.uint64) -> float:
    """A standard normal number from 64 random bits (Box and Muller), at most 6.8 in size."""
    radius = (np.float64(word >> _S32) + 0.5) * 2.0**-32
    angle = np.float64(word & _LOW) * 2.0**-32
    return math.sqrt(-2.0 * math.log(radius)) * math.cos(2.0 * math.pi * angle)


@njit(cache=True)
def ziggurat_normal(word: np.uint64) -> float:
    """A standard normal number from 64 random bits, several times faster than `normal`.

    Layers of equal area under the density (Marsaglia and Tsang, "The Ziggurat Method", 2000):
    nearly always a product and a comparison; else more bits follow from the same word.
    """
    while True:
        size = layered_size(word)
        if math.isnan(size):
            size = _size_by_more_bits(word)
        if not math.isnan(size):
            return math.copysign(size, 2.0 * uniform(word) - 1.0)
        word = word_at(word, 0)


@njit(cache=True)
def layered_size(word: np.uint64) -> float:
    """The size of a `ziggurat_normal`, or NaN where its layer alone does not settle it."""
    layer = word & _LAYER_MASK
    size = abs(2.0 * uniform(word) - 1.0) * ZIGGURAT[layer]
    return size if size < ZIGGURAT[layer + _NEXT] else np.nan


@njit(cache=True)
def _size_by_more_bits(word: np.uint64) -> float:
    """The size where the layer does not settle it; NaN where a new word is needed."""
    layer = np.int64(word & _LAYER_MASK)
    size = abs(2.0 * uniform(word) - 1.0) * ZIGGURAT[layer]
    word = word_at(word, 0)
    if layer == 0:
        return _tail(word)
    low, high = ZIGGURAT[layer], ZIGGURAT[layer + 1]
    share = uniform(word_at(word, 1))
    heights = math.exp(-0.5 * low * low), math.exp(-0.5 * high * high)
    inside = heights[0] + share * (heights[1] - heights[0]) < math.exp(-0.5 * size * size)
    return size if inside else np.nan


@njit(cache=True)
def _tail(word: np.uint64) -> float:
    """The size of a normal number beyond the last layer."""
    while True:
        beyond = -math.log(1.0 - uniform(word_at(word, 1))) / _LAST_LAYER
        if -2.0 * math.log(1.0 - uniform(word_at(word, 2))) > beyond * beyond:
            return _LAST_LAYER + beyond
        word = word_at(word, 0)


@njit(cache=True)
def normal_quantile(word: np.uint64, quantiles: NDArray[np.float64]) -> float:
    """A roughly normal number, one of `NORMAL_QUANTILES`, from the 11 bits `uniform` leaves."""
    return quantiles[word & _QUANTILE_MASK]


@njit(cache=True)
def poisson(word: np.uint64, expected: float) -> int:
    """A Poisson number from 64 random bits, by inversion of the distribution."""
    target = uniform(word)
    if target <= 1.0 - expected:  # exp(-x) >= 1 - x spares the exponential nearly always
        return 0
    number, probability = 0, math.exp(-expected)
    cumulated = probability
    while target >= cumulated and number < _LARGEST_POISSON:
        number += 1
        probability *= expected / number
        cumulated += probability
    return number


def normal_map(key: np.uint64, size: int) -> NDArray[np.float64]:
    """`size` independent standard normal numbers, one for each pixel."""
    values = np.empty(size, np.float64)
    parts = np.array_split(values, useful_bands(size))
    firsts = np.cumsum([0, *map(len, parts)])
    with ThreadPoolExecutor(len(parts)) as beside:
        list(beside.map(partial(_draw_normals, key), firsts, parts))
    return values


@njit(cache=True, nogil=True)
def _draw_normals(key: np.uint64, first: int, values: NDArray[np.float64]) -> None:
    for index in range(values.size):
        values[index] = normal(word_at(key, first + index))


@njit(cache=True)
def uniform_map(key: np.uint64, size: int) -> NDArray[np.float64]:
    """`size` independent numbers in [0, 1), one for each pixel."""
    values = np.empty(size, np.float64)
    for pixel in range(size):
        values[pixel] = uniform(word_at(key, pixel))
    return values
