"""Compiled painting of the actors in front of the street, and what is visible of them.

Polygons count by the share of the pixel they cover, so that actors too move smoothly.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from eqs.kernels import njit
from eqs.scenes.optics import Array, coverage
from eqs.scenes.paint_street import Picture
from eqs.scenes.parts import ATOP, SHADOW, SOLID
from eqs.scenes.polygons import COLOUR, EDGES, JOIN, RING, STRENGTH, X0, X1, Y0, Y1, Polygons

Span = tuple[int, int]

NARROW_PX: Final = 5  # looking for spans in a narrower polygon costs more than it saves


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
