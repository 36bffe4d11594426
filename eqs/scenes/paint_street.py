"""Compiled painting of the street: sky, building fronts and ground.

Surfaces are averaged over the footprint of each pixel through summed-area tables: the picture
changes smoothly when the camera moves by a fraction of a pixel, which a renderer at 1 kHz needs
if it is not to flicker.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eqs.kernels import njit
from eqs.scenes.light import AMBIENT, BEAM, BEAM_REACH_M, HAZE, HAZE_REACH
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
)

Picture = NDArray[np.float32]
Position = tuple[int, float, float]  # cell, fraction of it, whole periods

# What one column of pixels has in common: direction, row of the horizon, depth of the front, first
# row of the ground, light of the headlights relative to the ambient light.
DIR_X, DIR_Z, SHIFT, DEPTH, BASE, GLOW = range(6)
COLUMN_FACTS: Final = 6

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
