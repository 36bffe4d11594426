"""Compiled per-pixel work: the street's surfaces, the actors in front of them, what is visible.

Surfaces are averaged over the footprint of each pixel through summed-area tables, polygons count
by the share of the pixel they cover: the picture changes smoothly when the camera moves by a
fraction of a pixel, which a renderer at 1 kHz needs if it is not to flicker.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from eqs.scenes.actors import ATOP, SHADOW, SOLID
from eqs.scenes.optics import (
    CAM_COS,
    CAM_PITCH,
    CAM_ROLL,
    CAM_SIN,
    CAM_X,
    CAM_Y,
    CAM_Z,
    FOCAL,
    MID_COLUMN,
    MID_ROW,
    Array,
    coverage,
)
from eqs.scenes.outline import (
    AMBIENT,
    BEAM,
    BEAM_REACH_M,
    COLOUR,
    EDGES,
    HAZE,
    HAZE_REACH,
    JOIN,
    RING,
    STRENGTH,
    X0,
    X1,
    Y0,
    Y1,
    Polygons,
)

Picture = NDArray[np.float32]
Position = tuple[int, float, float]  # cell, fraction of it, whole periods

VISTA_M: Final = 160.0  # beyond this depth the street ends in haze


class Surfaces(NamedTuple):
    """Textures of the street as summed-area tables, and where they lie.

    Args:
        road: integral over (x, z) of radiance in lux, shape (nx + 1, nz + 1), periodic in z.
        left: the same over (height, z) for the left side, shape (ny + 1, nz + 1).
        right: the same for the right side.
        roofs: integral over z of the height of left and right buildings, shape (2, nz + 1).
        sky: radiance in lux at the horizon and at 45 degrees, cloud contrast, shape (3,).
        texel_m: side of a texel.
        half_street_m: distance of either side from the middle.
    """

    road: Array
    left: Array
    right: Array
    roofs: Array
    sky: Array
    texel_m: float
    half_street_m: float


@njit(cache=True, error_model="numpy")
def _wrapped(position: float, period: int) -> tuple[int, float, float]:
    """Cell, fraction and number of whole periods of a texel position."""
    turns = math.floor(position / period)
    inside = position - turns * period
    cell = min(int(inside), period - 1)
    return cell, inside - cell, turns


@njit(cache=True, error_model="numpy")
def _row_integral(table: Array, level: int, lower: Position, upper: Position) -> float:
    """Integral along z of one row of the table between two wrapped positions."""
    row = table[level]
    total = row[row.shape[0] - 1]
    high = row[upper[0]] + upper[1] * (row[upper[0] + 1] - row[upper[0]]) + upper[2] * total
    low = row[lower[0]] + lower[1] * (row[lower[0] + 1] - row[lower[0]]) + lower[2] * total
    return high - low


@njit(cache=True, error_model="numpy")
def _area_integral(table: Array, level: float, lower: Position, upper: Position) -> float:
    """Integral from the table's first row to the fractional row `level`."""
    top = table.shape[0] - 1
    level = min(max(level, 0.0), float(top))
    cell = min(int(level), top - 1)
    base = _row_integral(table, cell, lower, upper)
    return base + (level - cell) * (_row_integral(table, cell + 1, lower, upper) - base)


@njit(cache=True, error_model="numpy")
def _sky_radiance(slope_up: float, azimuth: float, sky: Array) -> float:
    """Radiance of the sky at a slope above the horizon, with soft clouds fixed in azimuth."""
    blend = min(max(slope_up, 0.0), 1.0)
    clouds = math.sin(7.0 * azimuth + 1.3) + math.sin(17.0 * azimuth + 9.0 * blend)
    return (sky[0] + blend * (sky[1] - sky[0])) * (1.0 + 0.5 * sky[2] * clouds)


@njit(cache=True, error_model="numpy")
def paint_street(image: Picture, surfaces: Surfaces, camera: Array, light: Array) -> None:
    """Paint sky, building fronts and ground into `image`, float32 lux, shape (H, W).

    Pixels of one column look along one vertical plane, so they share a front's position along
    the street; and the bottom of one pixel is the top of the next.
    """
    height, width = image.shape
    focal, texel = camera[FOCAL], surfaces.texel_m
    for column in range(width):
        a = (column + 0.5 - camera[MID_COLUMN]) / focal
        dir_x = a * camera[CAM_COS] + camera[CAM_SIN]
        dir_z = camera[CAM_COS] - a * camera[CAM_SIN]
        shift = camera[MID_ROW] + focal * (camera[CAM_PITCH] + camera[CAM_ROLL] * a)
        right = dir_x > 0.0
        wall = surfaces.right if right else surfaces.left
        offset = (surfaces.half_street_m if right else -surfaces.half_street_m) - camera[CAM_X]
        depth = min(offset / dir_x if abs(dir_x) > 1e-9 else VISTA_M, VISTA_M)
        haze = 1.0 - math.exp(-depth / light[HAZE_REACH])
        if depth > 0.75 * VISTA_M:
            haze += (1.0 - haze) * (depth / VISTA_M - 0.75) * 4.0
        # Share of the front's row covered by this column: |dz/da| = offset / dir_x^2.
        half = 0.5 * max(abs(depth / max(abs(dir_x), 1e-3)) / focal, texel)
        half = min(half, 20.0)
        middle = camera[CAM_Z] + depth * dir_z
        period = wall.shape[1] - 1
        lower = _wrapped((middle - half) / texel, period)
        upper = _wrapped((middle + half) / texel, period)
        span = 2.0 * half / texel
        roof = _row_integral(surfaces.roofs, 1 if right else 0, lower, upper) / span
        scale = depth / focal  # metres of front per row
        roof_row = shift - (roof - camera[CAM_Y]) / scale
        base_row = shift + camera[CAM_Y] / scale
        azimuth = math.atan2(dir_x, dir_z)
        above = _area_integral(wall, (roof + scale) / texel, lower, upper)
        beam_across = light[BEAM] * math.exp(-((a / 0.4) ** 2))
        for row in range(height):
            value, share = 0.0, 0.0
            sky_share = min(max(roof_row - row, 0.0), 1.0)
            ground_share = min(max(row + 1.0 - base_row, 0.0), 1.0)
            if sky_share > 0.0:
                slope = (shift - (row + 0.5)) / focal
                value += sky_share * _sky_radiance(slope, azimuth, surfaces.sky)
            share = 1.0 - sky_share - ground_share
            if share > 1e-6:
                top = min(camera[CAM_Y] - (row - shift) * scale, roof + scale)
                below_m = camera[CAM_Y] - (row + 1.0 - shift) * scale
                if sky_share > 0.0:
                    above = _area_integral(wall, top / texel, lower, upper)
                below = _area_integral(wall, below_m / texel, lower, upper)
                if ground_share > 0.0:
                    below_m = 0.0
                cells = span * max((top - max(below_m, 0.0)) / texel, 1e-9)
                front = (above - below) / cells
                above = below
                value += share * (front * (1.0 - haze) + light[HAZE] * haze)
            if ground_share > 0.0:
                value += ground_share * _ground(
                    surfaces, camera, light, row, shift, dir_x, dir_z, beam_across, base_row
                )
            image[row, column] = value


@njit(cache=True, error_model="numpy")
def _ground(
    surfaces: Surfaces,
    camera: Array,
    light: Array,
    row: int,
    shift: float,
    dir_x: float,
    dir_z: float,
    beam: float,
    base_row: float,
) -> float:
    focal, texel = camera[FOCAL], surfaces.texel_m
    top = max(row + 0.0, base_row) - shift
    bottom = max(row + 1.0 - shift, top + 1e-3)
    reach = camera[CAM_Y] * focal
    far, near = reach / max(top, 1e-3), reach / bottom
    depth = 0.5 * (far + near)
    half_z = 0.5 * max((far - near) * dir_z, texel)
    half_x = 0.5 * max(depth / focal, texel)
    z = camera[CAM_Z] + depth * dir_z
    x = camera[CAM_X] + depth * dir_x + surfaces.half_street_m
    table = surfaces.road
    period = table.shape[1] - 1
    half_z = min(half_z, 20.0)
    lower = _wrapped((z - half_z) / texel, period)
    upper = _wrapped((z + half_z) / texel, period)
    x0, x1 = max(x - half_x, 0.0), min(x + half_x, 2.0 * surfaces.half_street_m)
    if x1 - x0 < 0.5 * texel:
        x0, x1 = max(x1 - texel, 0.0), max(x1, texel)
    total = _area_integral(table, x1 / texel, lower, upper)
    total -= _area_integral(table, x0 / texel, lower, upper)
    value = total * texel * texel / (2.0 * half_z * (x1 - x0))
    if beam > 0.0:
        value *= 1.0 + beam / light[AMBIENT] / (1.0 + (depth / BEAM_REACH_M) ** 2)
    fade = math.exp(-depth / light[HAZE_REACH])
    return value * fade + light[HAZE] * (1.0 - fade)


@njit(cache=True, error_model="numpy")
def _actor_at(
    polygons: Polygons, first: int, last: int, column: int, row: int
) -> tuple[float, float, float]:
    """Premultiplied radiance, opacity, and solid coverage of one actor in one pixel."""
    x, y = column + 0.5, row + 0.5
    colour, opacity, solid = 0.0, 0.0, 0.0
    for p in range(first, last):
        marks = polygons.marks[p]
        if column < marks[X0] or column >= marks[X1] or row < marks[Y0] or row >= marks[Y1]:
            continue
        values = polygons.values[p]
        c = coverage(polygons.edges[p], marks[EDGES], x, y, 0.0)
        if values[RING] > 0.0 and c > 0.0:
            c -= coverage(polygons.edges[p], marks[EDGES], x, y, values[RING])
        if c <= 0.0:
            continue
        if marks[JOIN] == SOLID:
            colour += c * (values[COLOUR] - colour)
            opacity += c * (1.0 - opacity)
            solid += c * (1.0 - solid)
        elif marks[JOIN] == ATOP:
            colour += c * (values[COLOUR] * opacity - colour)
        elif marks[JOIN] == SHADOW:
            opacity += c * values[STRENGTH] * (1.0 - opacity)
    return colour, opacity, solid


@njit(cache=True, error_model="numpy")
def _bounds(polygons: Polygons, first: int, last: int) -> tuple[int, int, int, int]:
    x0, x1, y0, y1 = 1 << 30, 0, 1 << 30, 0
    for p in range(first, last):
        x0, x1 = min(x0, polygons.marks[p, X0]), max(x1, polygons.marks[p, X1])
        y0, y1 = min(y0, polygons.marks[p, Y0]), max(y1, polygons.marks[p, Y1])
    return x0, x1, y0, y1


@njit(cache=True, error_model="numpy")
def paint_actors(image: Picture, polygons: Polygons) -> None:
    """Paint the actors over `image`, far ones first."""
    for i in polygons.order:
        first, last = polygons.spans[i]
        x0, x1, y0, y1 = _bounds(polygons, first, last)
        for row in range(y0, y1):
            for column in range(x0, x1):
                colour, opacity, _ = _actor_at(polygons, first, last, column, row)
                if opacity > 0.0:
                    image[row, column] += colour - opacity * image[row, column]


@njit(cache=True, error_model="numpy")
def measure_actors(polygons: Polygons, owner: NDArray[np.int32], room: Array) -> Array:
    """Visible and whole area of each actor's solid outline inside the image.

    Args:
        polygons: filled storage.
        owner: int32 (H, W), set to the nearest actor that covers at least half a pixel, else -1.
        room: float64 (H, W) scratch; afterwards the share of each pixel no actor covers.

    Returns:
        Areas in pixels, columns visible and whole, shape (actors, 2).
    """
    areas = np.zeros((len(polygons.spans), 2))
    owner[:] = -1
    room[:] = 1.0
    for k in range(len(polygons.order) - 1, -1, -1):
        i = polygons.order[k]
        first, last = polygons.spans[i]
        x0, x1, y0, y1 = _bounds(polygons, first, last)
        for row in range(y0, y1):
            for column in range(x0, x1):
                solid = _actor_at(polygons, first, last, column, row)[2]
                if solid <= 0.0:
                    continue
                areas[i, 0] += solid * room[row, column]
                areas[i, 1] += solid
                if solid >= 0.5 and owner[row, column] < 0:
                    owner[row, column] = i
                room[row, column] *= 1.0 - solid
    return areas
