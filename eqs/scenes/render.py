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
Span = tuple[int, int]
Position = tuple[int, float, float]  # cell, fraction of it, whole periods

# What one column of pixels has in common: direction, row of the horizon, depth of the front, first
# row of the ground, light of the headlights relative to the ambient light.
DIR_X, DIR_Z, SHIFT, DEPTH, BASE, GLOW = range(6)
COLUMN_FACTS: Final = 6

NARROW_PX: Final = 5  # looking for spans in a narrower polygon costs more than it saves

VISTA_M: Final = 160.0  # beyond this depth the street ends in haze


class Surfaces(NamedTuple):
    """Textures of the street as summed-area tables, and where they lie.

    Args:
        road: integral over (z, x) of radiance in lux, shape (nz + 1, nx + 1), periodic in z.
        left: the same over (z, height) for the left side, shape (nz + 1, ny + 1).
        right: the same for the right side.
        roofs: integral over z of the height of left and right buildings, shape (nz + 1, 2).
        sky: radiance in lux at the horizon and at 45 degrees, cloud contrast, shape (3,).
        texels_per_m: resolution of the textures.
        half_street_m: distance of either side from the middle.
    """

    road: Array
    left: Array
    right: Array
    roofs: Array
    sky: Array
    texels_per_m: float
    half_street_m: float


@njit(cache=True, error_model="numpy")
def _wrapped(position: float, period: int, turns_per_texel: float) -> Position:
    """Cell, fraction and number of whole periods of a texel position."""
    turns = math.floor(position * turns_per_texel)
    inside = max(position - turns * period, 0.0)
    cell = min(int(inside), period - 1)
    return cell, inside - cell, turns


@njit(cache=True, error_model="numpy")
def _strip_integral(table: Array, level: int, lower: Position, upper: Position) -> float:
    """Integral along z, between two wrapped positions, of the table's column `level`."""
    high, low = table[upper[0], level], table[lower[0], level]
    high += upper[1] * (table[upper[0] + 1, level] - high)
    low += lower[1] * (table[lower[0] + 1, level] - low)
    return high - low + (upper[2] - lower[2]) * table[table.shape[0] - 1, level]


@njit(cache=True, error_model="numpy")
def _area_integral(table: Array, level: float, lower: Position, upper: Position) -> float:
    """Integral along z and, across, from the table's first column to the fraction `level`."""
    top = table.shape[1] - 1
    level = min(max(level, 0.0), float(top))
    cell = min(int(level), top - 1)
    base = _strip_integral(table, cell, lower, upper)
    return base + (level - cell) * (_strip_integral(table, cell + 1, lower, upper) - base)


@njit(cache=True, error_model="numpy")
def _sky_radiance(slope_up: float, clouds: tuple[float, float], sky: Array) -> float:
    """Radiance of the sky at a slope above the horizon; clouds change from low to high."""
    blend = min(max(slope_up, 0.0), 1.0)
    cloud = clouds[0] + blend * clouds[1]
    return (sky[0] + blend * (sky[1] - sky[0])) * (1.0 + sky[2] * cloud)


@njit(cache=True, error_model="numpy")
def paint_street(
    image: Picture, surfaces: Surfaces, camera: Array, light: Array, columns: Array
) -> None:
    """Paint sky, building fronts and ground.

    Args:
        image: light in lux, overwritten, shape (H, W).
        surfaces: the street's textures.
        camera: camera vector.
        light: light vector.
        columns: scratch, shape (W, COLUMN_FACTS).
    """
    _paint_fronts(image, surfaces, camera, light, columns)
    _paint_ground(image, surfaces, camera, light, columns)


@njit(cache=True, error_model="numpy")
def _paint_fronts(
    image: Picture, surfaces: Surfaces, camera: Array, light: Array, columns: Array
) -> None:
    """Paint sky and fronts column by column, and note where the ground begins in each."""
    focal = camera[FOCAL]
    for column in range(image.shape[1]):
        a = (column + 0.5 - camera[MID_COLUMN]) / focal
        dir_x = a * camera[CAM_COS] + camera[CAM_SIN]
        aim = columns[column]
        aim[DIR_X], aim[DIR_Z] = dir_x, camera[CAM_COS] - a * camera[CAM_SIN]
        aim[SHIFT] = camera[MID_ROW] + focal * (camera[CAM_PITCH] + camera[CAM_ROLL] * a)
        offset = math.copysign(surfaces.half_street_m, dir_x) - camera[CAM_X]
        aim[DEPTH] = min(offset / dir_x if abs(dir_x) > 1e-9 else VISTA_M, VISTA_M)
        aim[BASE] = aim[SHIFT] + camera[CAM_Y] * focal / aim[DEPTH]
        aim[GLOW] = light[BEAM] / light[AMBIENT] * math.exp(-((a / 0.4) ** 2))
        _paint_front(image, column, surfaces, camera, light, aim)


@njit(cache=True, error_model="numpy")
def _paint_front(
    image: Picture, column: int, surfaces: Surfaces, camera: Array, light: Array, aim: Array
) -> None:
    """Paint sky and front in one column.

    Its pixels look along one vertical plane, so they share the position along the street; and
    the bottom of one pixel is the top of the next.
    """
    dir_x, depth, shift, focal = aim[DIR_X], aim[DEPTH], aim[SHIFT], camera[FOCAL]
    per_m, period = surfaces.texels_per_m, surfaces.road.shape[0] - 1
    wall, side = (surfaces.right, 1) if dir_x > 0.0 else (surfaces.left, 0)
    # Share of the front's length seen by this column: |dz/da| = |offset| / dir_x^2.
    half = min(max(0.5 * depth / max(abs(dir_x), 1e-3) / focal * per_m, 0.5), 0.2 * period)
    middle = (camera[CAM_Z] + depth * aim[DIR_Z]) * per_m
    lower = _wrapped(middle - half, period, 1.0 / period)
    upper = _wrapped(middle + half, period, 1.0 / period)
    scale, eye = depth / focal * per_m, camera[CAM_Y] * per_m  # texels per row, and of the eye
    roof = _strip_integral(surfaces.roofs, side, lower, upper) / (2.0 * half)
    roof_row = shift - (roof - eye) / scale
    haze = depth / (depth + light[HAZE_REACH])
    haze += (1.0 - haze) * max(0.0, 4.0 * depth / VISTA_M - 3.0)
    azimuth = math.atan2(dir_x, aim[DIR_Z])
    clouds = (math.sin(7.0 * azimuth + 1.3), 2.0 * math.sin(17.0 * azimuth + 0.4))
    above = -1.0  # integral of the front up to the top of the row, once known
    for row in range(min(image.shape[0], max(0, math.ceil(aim[BASE])))):
        value = 0.0
        sky_share = min(max(roof_row - row, 0.0), 1.0)
        share = 1.0 - sky_share - min(max(row + 1.0 - aim[BASE], 0.0), 1.0)
        if sky_share > 0.0:
            slope = (shift - (row + 0.5)) / focal
            value += sky_share * _sky_radiance(slope, clouds, surfaces.sky)
        if share > 1e-6:
            top = min(eye - (row - shift) * scale, roof)
            bottom = max(eye - (row + 1.0 - shift) * scale, 0.0)
            if above < 0.0:
                above = _area_integral(wall, top, lower, upper)
            below = _area_integral(wall, bottom, lower, upper)
            front = (above - below) / (2.0 * half * max(top - bottom, 1e-9))
            above = below
            value += share * (front * (1.0 - haze) + light[HAZE] * haze)
        image[row, column] = value


@njit(cache=True, error_model="numpy")
def _paint_ground(
    image: Picture, surfaces: Surfaces, camera: Array, light: Array, columns: Array
) -> None:
    """Paint the ground row by row, where one row's depth keeps the texture in the cache."""
    height, width = image.shape
    table, per_m = surfaces.road, surfaces.texels_per_m
    period, widest = table.shape[0] - 1, float(table.shape[1] - 1)
    reach, turns = camera[CAM_Y] * camera[FOCAL], 1.0 / period
    for row in range(height):
        for column in range(width):
            share = min(row + 1.0 - columns[column, BASE], 1.0)
            if share <= 0.0:
                continue
            shift, dir_z = columns[column, SHIFT], columns[column, DIR_Z]
            top = max(max(row + 0.0, columns[column, BASE]) - shift, 1e-3)
            bottom = max(row + 1.0 - shift, top + 1e-3)
            far, near = reach / top, reach / bottom
            depth = 0.5 * (far + near)
            # Everything below counts in texels; a pixel covers at least one.
            half_z = 0.5 * min(max((far - near) * dir_z * per_m, 1.0), 0.4 * period)
            half_x = 0.5 * max(depth * per_m / camera[FOCAL], 1.0)
            z = (camera[CAM_Z] + depth * dir_z) * per_m
            x = camera[CAM_X] + depth * columns[column, DIR_X] + surfaces.half_street_m
            lower = _wrapped(z - half_z, period, turns)
            upper = _wrapped(z + half_z, period, turns)
            x1 = min(max(x * per_m + half_x, 1.0), widest)
            x0 = max(min(x * per_m - half_x, x1 - 1.0), 0.0)
            total = _area_integral(table, x1, lower, upper)
            total -= _area_integral(table, x0, lower, upper)
            value = total / (2.0 * half_z * (x1 - x0))
            if columns[column, GLOW] > 0.0:
                value *= 1.0 + columns[column, GLOW] / (1.0 + (depth / BEAM_REACH_M) ** 2)
            fade = light[HAZE_REACH] / (light[HAZE_REACH] + depth)
            value = value * fade + light[HAZE] * (1.0 - fade)
            if share < 1.0:  # the rest of the pixel shows the front
                value = image[row, column] + share * value
            image[row, column] = value


@njit(cache=True, error_model="numpy")
def _row_span(edges: Array, count: int, y: float, margin: float, x0: int, x1: int) -> Span:
    """Columns of one row whose centres lie at least `margin` pixels inside every edge."""
    low, high = float(x0), float(x1)
    for i in range(count):
        a, rest = edges[i, 0], edges[i, 1] * y + edges[i, 2] - margin
        if abs(a) < 1e-9:
            if rest < 0.0:
                return x0, x0
        elif a > 0.0:
            low = max(low, -rest / a - 0.5)
        else:
            high = min(high, -rest / a + 0.5)
    first = min(max(math.ceil(low), x0), x1)
    return first, max(first, min(math.floor(high), x1))


@njit(cache=True, error_model="numpy")
def _join(layers: Array, row: int, column: int, join: int, c: float, values: Array) -> None:
    """Lay a share `c` of one polygon over one pixel of an actor's picture."""
    if join == SOLID:
        layers[0, row, column] += c * (values[COLOUR] - layers[0, row, column])
        layers[1, row, column] += c * (1.0 - layers[1, row, column])
        layers[2, row, column] += c * (1.0 - layers[2, row, column])
    elif join == ATOP:
        opacity = layers[1, row, column]
        layers[0, row, column] += c * (values[COLOUR] * opacity - layers[0, row, column])
    elif join == SHADOW:
        layers[1, row, column] += c * values[STRENGTH] * (1.0 - layers[1, row, column])


@njit(cache=True, error_model="numpy")
def _fill(layers: Array, row: int, begin: int, end: int, join: int, values: Array) -> None:
    """Lay the whole of one polygon over pixels that it covers entirely."""
    if join == SOLID:
        for column in range(begin, end):
            layers[0, row, column] = values[COLOUR]
            layers[1, row, column] = 1.0
            layers[2, row, column] = 1.0
    elif join == ATOP:
        for column in range(begin, end):
            layers[0, row, column] = values[COLOUR] * layers[1, row, column]
    else:
        for column in range(begin, end):
            layers[1, row, column] += values[STRENGTH] * (1.0 - layers[1, row, column])


@njit(cache=True, error_model="numpy")
def _paint_actor(layers: Array, polygons: Polygons, first: int, last: int) -> None:
    """Paint one actor into premultiplied radiance, opacity and solid coverage, (3, H, W)."""
    for p in range(first, last):
        marks, values, edges = polygons.marks[p], polygons.values[p], polygons.edges[p]
        count, join, ring = marks[EDGES], marks[JOIN], values[RING]
        for row in range(marks[Y0], marks[Y1]):
            y = row + 0.5
            begin, end = int(marks[X0]), int(marks[X1])
            inner = outer = end
            if end - begin > NARROW_PX:
                begin, end = _row_span(edges, count, y, -0.5, begin, end)
                inner = outer = end
                if ring == 0.0:
                    inner, outer = _row_span(edges, count, y, 0.5, begin, end)
            for column in range(begin, inner):
                c = coverage(edges, count, column + 0.5, y, 0.0)
                if ring > 0.0:
                    c -= coverage(edges, count, column + 0.5, y, ring)
                _join(layers, row, column, join, c, values)
            _fill(layers, row, inner, outer, join, values)
            for column in range(outer, end):
                c = coverage(edges, count, column + 0.5, y, 0.0)
                _join(layers, row, column, join, c, values)


@njit(cache=True, error_model="numpy")
def _bounds(polygons: Polygons, first: int, last: int) -> tuple[int, int, int, int]:
    x0, x1, y0, y1 = 1 << 30, 0, 1 << 30, 0
    for p in range(first, last):
        x0, x1 = min(x0, polygons.marks[p, X0]), max(x1, polygons.marks[p, X1])
        y0, y1 = min(y0, polygons.marks[p, Y0]), max(y1, polygons.marks[p, Y1])
    return x0, x1, y0, y1


@njit(cache=True, error_model="numpy")
def paint_actors(image: Picture, polygons: Polygons, layers: Array) -> None:
    """Paint the actors over `image`, far ones first; `layers` is scratch, shape (3, H, W)."""
    for i in polygons.order:
        first, last = polygons.spans[i]
        x0, x1, y0, y1 = _bounds(polygons, first, last)
        if x0 >= x1 or y0 >= y1:
            continue
        layers[:2, y0:y1, x0:x1] = 0.0
        _paint_actor(layers, polygons, first, last)
        for row in range(y0, y1):
            for column in range(x0, x1):
                opacity = layers[1, row, column]
                if opacity > 0.0:
                    image[row, column] += layers[0, row, column] - opacity * image[row, column]


@njit(cache=True, error_model="numpy")
def measure_actors(polygons: Polygons, owner: NDArray[np.int32], layers: Array) -> Array:
    """Visible and whole area of each actor's solid outline inside the image.

    Args:
        polygons: filled storage.
        owner: set to the nearest actor that covers at least half a pixel, else -1, shape (H, W).
        layers: scratch, shape (3, H, W).

    Returns:
        Areas in pixels, columns visible and whole, shape (actors, 2).
    """
    areas = np.zeros((len(polygons.spans), 2))
    free = np.ones(owner.shape)  # share of each pixel that no nearer actor covers
    owner[:] = -1
    for k in range(len(polygons.order) - 1, -1, -1):
        i = polygons.order[k]
        first, last = polygons.spans[i]
        x0, x1, y0, y1 = _bounds(polygons, first, last)
        if x0 >= x1 or y0 >= y1:
            continue
        layers[:, y0:y1, x0:x1] = 0.0
        _paint_actor(layers, polygons, first, last)
        for row in range(y0, y1):
            for column in range(x0, x1):
                solid = layers[2, row, column]
                areas[i, 0] += solid * free[row, column]
                areas[i, 1] += solid
                if solid >= 0.5 and owner[row, column] < 0:
                    owner[row, column] = i
                free[row, column] *= 1.0 - solid
    return areas
