"""Compiled painter of shapes before a textured wall."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from eqs.kernels import njit

OBJECT_COLUMNS: Final = 8  # x, y, size, angle, shape, albedo, contrast, patch
TEXELS: Final = 200.0  # of an object's texture per image height


@njit(cache=True)
def radius_at(shape: int, theta: float) -> float:
    """Distance of a shape's outline from its middle in a direction: disc, box, star or cross."""
    if shape == 0:
        return 1.0
    across, along = abs(math.cos(theta)), abs(math.sin(theta))
    if shape == 1:
        return 0.85 / max(across, along)
    if shape == 2:
        return 0.7 + 0.3 * math.cos(5.0 * theta)
    arm = 0.3 / max(min(across, along), 1e-6)
    return min(0.95 / max(across, along), arm) if arm > 0.42 else 0.42


@njit(cache=True, error_model="numpy")
def _texel(texture: NDArray[np.float32], row: float, column: float) -> float:
    """The periodic texture between four texels."""
    side = len(texture)
    i, j = math.floor(row), math.floor(column)
    down, right = row - i, column - j
    i0, j0 = int(i) % side, int(j) % side
    i1, j1 = (i0 + 1) % side, (j0 + 1) % side
    above = texture[i0, j0] * (1.0 - right) + texture[i0, j1] * right
    below = texture[i1, j0] * (1.0 - right) + texture[i1, j1] * right
    between: float = above * (1.0 - down) + below * down
    return between


@njit(cache=True, error_model="numpy")
def paint_objects(
    image: NDArray[np.float32],
    texture: NDArray[np.float32],
    camera: NDArray[np.float64],
    objects: NDArray[np.float64],
    light: float,
) -> None:
    """Fill `image` with the light that wall and objects send, the last object nearest.

    Args:
        image: rows of the picture, lux, written to.
        texture: periodic wall, share of the light that comes back.
        camera: shift right and down in image heights, cosine and sine of the turn, and texels of
            the wall per image height.
        objects: one row of `OBJECT_COLUMNS` per object; lengths in image heights.
        light: what white sends, lux.
    """
    height, width = image.shape
    for i in range(height):
        y = (i + 0.5) / height - 0.5
        for j in range(width):
            x = (j + 0.5) / height - 0.5 * width / height
            u = camera[2] * x - camera[3] * y + camera[0]
            v = camera[3] * x + camera[2] * y + camera[1]
            value = _texel(texture, v * camera[4], u * camera[4])
            for k in range(len(objects)):
                across = x + 0.5 * width / height - objects[k, 0]
                along = y + 0.5 - objects[k, 1]
                size = objects[k, 2]
                distance = math.hypot(across, along)
                if distance > 1.5 * size:
                    continue
                theta = math.atan2(along, across) - objects[k, 3]
                edge = (radius_at(int(objects[k, 4]), theta) * size - distance) * height + 0.5
                if edge <= 0.0:
                    continue
                row = objects[k, 7] + TEXELS * distance * math.sin(theta)
                column = TEXELS * distance * math.cos(theta)
                painted = objects[k, 6] * 2.5 * _texel(texture, row, column)
                own = objects[k, 5] * (1.0 - objects[k, 6] + painted)
                value += (own - value) * min(edge, 1.0)
            image[i, j] = light * value
