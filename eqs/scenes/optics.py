"""Compiled image geometry: projection, convex outlines, and how much of a pixel they cover."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from eqs.kernels import njit

Array = NDArray[np.float64]

NEAR_M: Final = 0.4

# Columns of a camera vector. World axes: x to the right of the street, y up, z along it. Yaw is
# exact; pitch and roll are small and only shift and shear the image.
CAM_X, CAM_Y, CAM_Z, CAM_COS, CAM_SIN, CAM_PITCH, CAM_ROLL, FOCAL, MID_ROW, MID_COLUMN = range(10)
CAMERA_COLUMNS: Final = 10


@njit(cache=True, error_model="numpy")
def project(x: float, y: float, z: float, camera: Array, point: Array) -> float:
    """Write column and row of a world point; returns its depth in metres.

    Points behind the near plane are moved onto it, which keeps the outline of an object that
    passes the camera continuous in time; it is outside the field of view by then.
    """
    dx, dy, dz = x - camera[CAM_X], y - camera[CAM_Y], z - camera[CAM_Z]
    depth = max(dx * camera[CAM_SIN] + dz * camera[CAM_COS], NEAR_M)
    across = camera[FOCAL] * (dx * camera[CAM_COS] - dz * camera[CAM_SIN]) / depth
    point[0] = across + camera[MID_COLUMN]
    down = camera[FOCAL] * (camera[CAM_PITCH] - dy / depth)
    point[1] = camera[MID_ROW] + down + camera[CAM_ROLL] * across
    return depth


@njit(cache=True, error_model="numpy")
def _turn(hull: Array, size: int, x: float, y: float) -> float:
    ax, ay = hull[size - 2, 0], hull[size - 2, 1]
    return (hull[size - 1, 0] - ax) * (y - ay) - (hull[size - 1, 1] - ay) * (x - ax)


@njit(cache=True, error_model="numpy")
def convex_hull(points: Array, count: int, hull: Array) -> int:
    """Convex outline of `points[:count]`, which get sorted; returns its number of corners.

    Source: Andrew's monotone chain.
    """
    for i in range(1, count):
        px, py = points[i, 0], points[i, 1]
        j = i - 1
        while j >= 0 and (points[j, 0] > px or (points[j, 0] == px and points[j, 1] > py)):
            points[j + 1, 0], points[j + 1, 1] = points[j, 0], points[j, 1]
            j -= 1
        points[j + 1, 0], points[j + 1, 1] = px, py
    size = 0
    for sweep in range(2):
        start = size
        for k in range(count):
            i = k if sweep == 0 else count - 1 - k
            while size >= start + 2 and _turn(hull, size, points[i, 0], points[i, 1]) <= 0.0:
                size -= 1
            hull[size, 0], hull[size, 1] = points[i, 0], points[i, 1]
            size += 1
        size -= 1
    return size


@njit(cache=True, error_model="numpy")
def signed_area(corners: Array, count: int) -> float:
    """Area of a polygon in square pixels, positive when its corners run clockwise on screen."""
    area = 0.0
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        area += corners[i, 0] * corners[j, 1] - corners[j, 0] * corners[i, 1]
    return 0.5 * area


@njit(cache=True, error_model="numpy")
def set_edges(corners: Array, count: int, edges: Array) -> int:
    """Write a convex outline as half planes `a x + b y + c >= 0`, in pixels inside the edge.

    Returns the number of edges, 0 for a polygon without area.
    """
    area = signed_area(corners, count)
    if abs(area) < 1e-6:
        return 0
    sign = 1.0 if area > 0.0 else -1.0
    used = 0
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        ex, ey = corners[j, 0] - corners[i, 0], corners[j, 1] - corners[i, 1]
        length = math.sqrt(ex * ex + ey * ey)
        if length < 1e-6:
            continue
        a, b = -sign * ey / length, sign * ex / length
        edges[used, 0], edges[used, 1] = a, b
        edges[used, 2] = -(a * corners[i, 0] + b * corners[i, 1])
        used += 1
    return used


@njit(cache=True, error_model="numpy")
def coverage(edges: Array, count: int, x: float, y: float, inset_px: float) -> float:
    """Share of the unit pixel centred on (x, y) inside the polygon shrunk by `inset_px`.

    Exact for one edge along a pixel side and for a strip between two such edges, so that a
    far-away pole dims smoothly instead of flickering; corners come out slightly rounded.
    """
    outside = 0.0
    for i in range(count):
        inside = edges[i, 0] * x + edges[i, 1] * y + edges[i, 2] - inset_px + 0.5
        if inside <= 0.0:
            return 0.0
        if inside < 1.0:
            outside += 1.0 - inside
    return max(0.0, 1.0 - outside)
