"""Textures of the procedural street: what building fronts and ground are, and how they are lit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Map = NDArray[np.floating]
Mask = NDArray[np.bool_]

PERIOD_M: Final = 96.0
FRONT_M: Final = 16.0
FLOOR_M: Final = 3.2
HALF_STREET_M: Final = 10.0
KERB_M: Final = 6.2
HEDGE_M: Final = 3.5  # nothing lower is a building
LAMP_SPACING_M: Final = 24.0


@dataclass(frozen=True, kw_only=True)
class Lighting:
    """Where the light in the street comes from.

    Args:
        ambient_lux: illuminance of a white surface at the focal plane without sun or lamps.
        sun_lux: what direct sun adds.
        sun_side: -1 if the sun shines on the left fronts, 1 on the right ones.
        lamp_lux: what a street lamp adds in the middle of its pool; zero by day.
        window_lux: radiance of a lit window; zero by day.
    """

    ambient_lux: float
    sun_lux: float
    sun_side: float
    lamp_lux: float
    window_lux: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Front:
    """One side of the street before light falls on it, in texels over (height, z).

    Args:
        albedo: share of the light that comes back.
        glow: radiance of lit windows, lux.
        glass: where there are windows.
        roofs: height of the building in metres over z.
    """

    albedo: Map
    glow: Map
    glass: Mask
    roofs: Map


@dataclass(frozen=True, kw_only=True, eq=False)
class Ground:
    """Road and pavements before light falls on them, in texels over (x, z).

    Args:
        albedo: share of the light that comes back.
        white: where there is white paint.
    """

    albedo: Map
    white: Mask


def integrate(texture: Map) -> NDArray[np.float64]:
    """Summed-area table with a leading row and column of zeros."""
    table = np.zeros((texture.shape[0] + 1, texture.shape[1] + 1))
    table[1:, 1:] = texture.cumsum(0).cumsum(1)
    return table


def mottle(rng: np.random.Generator, shape: tuple[int, int], texel_m: float, depth: float) -> Map:
    """Factor around one with structure at several sizes, periodic along the second axis.

    It draws from a child of `rng`, so that the resolution does not change what is drawn next.
    """
    rng, total = rng.spawn(1)[0], np.zeros(shape)
    for size_m, weight in ((0.25, 0.7), (0.8, 0.8), (2.4, 0.6)):
        step = max(1, round(size_m / texel_m))
        coarse = rng.standard_normal((-(-shape[0] // step), -(-shape[1] // step)))
        total += weight * np.kron(coarse, np.ones((step, step)))[: shape[0], : shape[1]]
    return np.exp(depth * total)


def lamp_pools(texel_m: float, length: int) -> Map:
    """Relative light of the street lamps along z, shape (length,)."""
    z = (np.arange(length) + 0.5) * texel_m
    gap = z - LAMP_SPACING_M * np.round(z / LAMP_SPACING_M)
    return np.exp(-((gap / 7.0) ** 2))


def _cells(extent_m: tuple[float, float], texel_m: float) -> slice:
    return slice(round(extent_m[0] / texel_m), round(extent_m[1] / texel_m))


def _paint_windows(
    rng: np.random.Generator,
    wall: Front,
    extent_m: tuple[float, float],
    texel_m: float,
    roof_m: float,
    lit: float,
) -> None:
    """Add a grid of windows, some of them lit, to one building."""
    albedo = wall.albedo
    pitch = rng.uniform(2.4, 4.2)
    wide, tall = rng.uniform(0.45, 0.65) * pitch, rng.uniform(1.3, 2.0)
    sill = rng.uniform(0.7, 1.1)
    (first, last), columns = extent_m, _cells(extent_m, texel_m)
    glass = albedo[0, columns.start + 1] * rng.uniform(0.35, 0.6)
    for floor in range(int(roof_m / FLOOR_M)):
        shop = floor == 0 and rng.random() < 0.6
        bottom = 0.5 if shop else floor * FLOOR_M + sill
        y = _cells((bottom, bottom + (2.2 if shop else tall)), texel_m)
        at = first + 0.4
        while at + wide < last - 0.3:
            z = _cells((at, at + wide), texel_m)
            albedo[y, z] = glass
            wall.glass[y, z] = True
            if rng.random() < (0.7 if shop else 0.3):
                wall.glow[y, z] = lit * rng.uniform(0.2, 1.0) * (1.5 if shop else 1.0)
            at += pitch
        ledge = round(floor * FLOOR_M / texel_m)
        albedo[ledge : ledge + max(1, round(0.2 / texel_m)), columns] *= rng.choice([0.7, 1.3])


def front(rng: np.random.Generator, lighting: Lighting, texel_m: float) -> Front:
    """One side of the street, in texels of `texel_m`."""
    length, rows = round(PERIOD_M / texel_m), round(FRONT_M / texel_m)
    albedo = np.full((rows, length), 0.3)
    glass = np.zeros((rows, length), np.bool_)
    roofs = np.zeros(length)
    wall = Front(albedo=albedo, glow=np.zeros((rows, length)), glass=glass, roofs=roofs)
    start = 0.0
    while start < PERIOD_M:
        stop = start + rng.uniform(6.0, 16.0)
        if PERIOD_M - stop < 4.0:
            stop = PERIOD_M
        columns = _cells((start, stop), texel_m)
        if rng.random() < 0.14:  # a garden wall or hedge between two buildings
            roof = rng.uniform(2.0, HEDGE_M)
            albedo[:, columns] = rng.uniform(0.05, 0.12)
        else:
            roof = rng.uniform(6.5, FRONT_M - 1.0)
            albedo[:, columns] = np.exp(rng.uniform(np.log(0.2), np.log(0.4)))
            if rng.random() < 0.15:  # few: a detector has minutes to learn what is no object
                _paint_windows(rng, wall, (start, stop), texel_m, roof, lighting.window_lux)
        roofs[columns] = roof
        edge = max(1, round(0.25 / texel_m))
        albedo[:, columns.start : columns.start + edge] *= 0.8
        start = stop
    albedo *= mottle(rng, albedo.shape, texel_m, 0.1)
    return wall


def front_radiance(wall: Front, lighting: Lighting, side: float, texel_m: float) -> Map:
    """A lit front, radiance in lux over (height, z); `side` is -1 for the left one."""
    rows, length = wall.albedo.shape
    height = (np.arange(rows)[:, None] + 0.5) * texel_m
    light = np.full(wall.albedo.shape, lighting.ambient_lux)
    light += lighting.sun_lux * 0.7 * (side == lighting.sun_side)
    light += lighting.lamp_lux * 0.6 * lamp_pools(texel_m, length) * np.exp(-((height / 6.0) ** 2))
    radiance: Map = wall.albedo * light + wall.glow
    return radiance


def _markings(rng: np.random.Generator, x: Map, z: Map) -> tuple[Mask, Mask]:
    """Where there is white paint, and where a dark line, on the ground."""
    dashed = (np.abs(x) < 0.12) & (np.mod(z, 6.0) < 3.0)
    parking = (np.abs(np.abs(x) - 4.1) < 0.11) & (np.mod(z, 6.2) < 5.2)
    at = rng.uniform(0.0, PERIOD_M - 4.0)
    zebra = (z > at) & (z < at + 3.5) & (np.abs(x) < 5.9) & (np.mod(x, 1.0) < 0.5)
    kerb = np.abs(np.abs(x) - KERB_M) < 0.14
    slab = (np.abs(x) > KERB_M) & ((np.mod(z, 1.5) < 0.14) | (np.mod(np.abs(x), 1.25) < 0.13))
    return dashed | parking | zebra | kerb, slab


def ground(rng: np.random.Generator, texel_m: float) -> Ground:
    """Road and pavements, in texels of `texel_m`."""
    length, rows = round(PERIOD_M / texel_m), round(2.0 * HALF_STREET_M / texel_m)
    x = _across(rows, texel_m)
    z = ((np.arange(length) + 0.5) * texel_m)[None]
    asphalt, paving = rng.uniform(0.07, 0.13), rng.uniform(0.2, 0.32)
    albedo = np.where(np.abs(x) < KERB_M, asphalt, paving) * np.ones_like(z)
    albedo *= mottle(rng, albedo.shape, texel_m, 0.07)
    white, dark = _markings(rng, x, z)
    albedo[dark] *= 0.7
    for _ in range(4):  # patches, manholes and tar seams
        at_x, at_z = rng.uniform(-KERB_M, KERB_M), rng.uniform(1.0, PERIOD_M - 1.0)
        long_x, long_z = np.exp(rng.uniform(np.log(0.15), np.log(1.2), size=2))
        inside = (np.abs(x - at_x) < long_x) & (np.abs(z - at_z) < 2.0 * long_z)
        albedo[inside] *= rng.choice([0.5, 0.65, 1.5])
    albedo[white] = 0.55 * mottle(rng, albedo.shape, texel_m, 0.08)[white]
    return Ground(albedo=albedo, white=white)


def ground_radiance(
    road: Ground, lighting: Lighting, texel_m: float, roofs: tuple[Map, Map]
) -> Map:
    """Lit road and pavements, radiance in lux over (x, z); `roofs` are those left and right."""
    rows, length = road.albedo.shape
    # The sunny side's houses do not shade the road, those of the other side do.
    shading = roofs[0] if lighting.sun_side > 0 else roofs[1]
    edge = -HALF_STREET_M + 0.95 * shading[None]
    sunny = (_across(rows, texel_m) * np.sign(lighting.sun_side)) > edge
    light = lighting.ambient_lux + lighting.sun_lux * sunny
    radiance: Map = road.albedo * (light + lighting.lamp_lux * lamp_pools(texel_m, length)[None])
    return radiance


def _across(rows: int, texel_m: float) -> Map:
    """Metres right of the middle of the street, shape (rows, 1)."""
    x: Map = ((np.arange(rows) + 0.5) * texel_m - HALF_STREET_M)[:, None]
    return x
