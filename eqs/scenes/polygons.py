"""Convex polygons waiting to be painted, and the storage they are kept in."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eqs.kernels import njit
from eqs.scenes.optics import MID_COLUMN, MID_ROW, Array, set_edges

CORNERS: Final = 8
POLYGONS_PER_ACTOR: Final = 40

# Columns of polygon marks and values.
EDGES, JOIN, X0, X1, Y0, Y1 = range(6)
COLOUR, RING, STRENGTH = range(3)


class Polygons(NamedTuple):
    """Reusable storage for the polygons of one instant.

    Args:
        edges: half planes, shape (n, 8, 3).
        marks: number of edges, way of joining, pixel bounds, shape (n, 6).
        values: radiance in lux, ring width in pixels, opacity, shape (n, 3).
        spans: first and one past last polygon of each actor, shape (actors, 2).
        boxes: left, top, right, bottom of each actor's whole outline in pixels, shape (actors, 4).
        order: actors from far to near, shape (actors,).
        scratch: room for the corners of one part, shape (4, 16, 2).
    """

    edges: Array
    marks: NDArray[np.int32]
    values: Array
    spans: NDArray[np.int32]
    boxes: Array
    order: NDArray[np.int64]
    scratch: Array

    @classmethod
    def room_for(cls, actors: int) -> Polygons:
        """Storage for this many actors."""
        count = max(1, actors * POLYGONS_PER_ACTOR)
        return cls(
            edges=np.zeros((count, CORNERS, 3)),
            marks=np.zeros((count, 6), np.int32),
            values=np.zeros((count, 3)),
            spans=np.zeros((actors, 2), np.int32),
            boxes=np.zeros((actors, 4)),
            order=np.zeros(actors, np.int64),
            scratch=np.zeros((4, 16, 2)),
        )


@njit(cache=True, error_model="numpy")
def store(
    polygons: Polygons,
    used: int,
    corners: Array,
    count: int,
    join: int,
    colour: float,
    ring_px: float,
    strength: float,
    camera: Array,
) -> int:
    """Add a polygon that touches the image as number `used`; returns how many there are then."""
    edges = set_edges(corners, count, polygons.edges[used])
    if edges == 0:
        return used
    left, right, top, bottom = 1e9, -1e9, 1e9, -1e9
    for i in range(count):
        left, right = min(left, corners[i, 0]), max(right, corners[i, 0])
        top, bottom = min(top, corners[i, 1]), max(bottom, corners[i, 1])
    width, height = 2.0 * camera[MID_COLUMN], 2.0 * camera[MID_ROW]
    if right < -1.0 or bottom < -1.0 or left > width + 1.0 or top > height + 1.0:
        return used
    marks = polygons.marks[used]
    marks[EDGES], marks[JOIN] = edges, join
    marks[X0] = max(0.0, math.floor(left - 0.5))
    marks[X1] = min(width, math.ceil(right + 0.5))
    marks[Y0] = max(0.0, math.floor(top - 0.5))
    marks[Y1] = min(height, math.ceil(bottom + 0.5))
    values = polygons.values[used]
    values[COLOUR], values[RING], values[STRENGTH] = colour, ring_px, strength
    return used + 1
