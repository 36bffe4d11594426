"""Solid shapes of the actors' parts: corners and triangles in metres, as functions of time.

A part that is painted as its outline becomes what has that outline: frustums become solids, wheels
discs or rings, blobs spheres. What is painted atop of something else stands out by millimetres.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eqs.scenes.actors import Actor
from eqs.scenes.parts import (
    ALBEDO,
    ATOP,
    BLOB,
    EMIT,
    FRUSTUM,
    HIGH,
    LIFT,
    LOW,
    MODE,
    PANE,
    PHASE,
    RATE,
    SHADOW,
    SHAPE,
    SUBSTANCE,
    SWING,
    WHEEL,
)
from eqs.scenes.substances import Substance

Points = NDArray[np.float64]
Triangles = NDArray[np.int64]
Row = NDArray[np.float64]

PANE_INSET: Final = 0.18  # as the painter has it
STAND_OUT_M: Final = 0.006
ROUND: Final = 32  # corners of a disc
SIGNS: Final = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float)  # right, forward
QUAD: Final = np.array([[0, 1, 2], [0, 2, 3]])


class Look(NamedTuple):
    """What one mesh is made of.

    Args:
        substance: which.
        albedo: mean reflectance.
        emit: radiance in lux of a lamp that is lit.
    """

    substance: Substance
    albedo: float
    emit: float = 0.0


class Solid(NamedTuple):
    """Corners (n, 3) in metres right, up and forward of the actor's middle; triangles (m, 3)."""

    points: Points
    triangles: Triangles


def solids(actor: Actor, time_s: float) -> dict[Look, Solid]:
    """One mesh for each look of an actor; at all times the same looks, corners and triangles."""
    found: dict[Look, list[Solid]] = {}
    for look, solid in _parts(actor.parts, time_s):
        found.setdefault(look, []).append(solid)
    return {look: joined(pieces) for look, pieces in found.items()}


def placed(actor: Actor, points: Points, time_s: float) -> Points:
    """An actor's points as x, y, z in the world."""
    sine, cosine = np.sin(actor.heading), np.cos(actor.heading)
    way = actor.speed * time_s
    right, up, forward = points.T
    return np.stack(
        [
            actor.x + way * sine + right * cosine + forward * sine,
            up,
            actor.z + way * cosine - right * sine + forward * cosine,
        ],
        axis=1,
    )


def moves(actor: Actor) -> bool:
    """Whether an actor is elsewhere, or another, at another time."""
    parts = actor.parts
    return actor.speed != 0.0 or bool(np.any(parts[:, RATE] * parts[:, SWING]))


def joined(pieces: list[Solid]) -> Solid:
    """Several solids as one."""
    starts = np.cumsum([0] + [len(piece.points) for piece in pieces[:-1]])
    triangles = [piece.triangles + start for piece, start in zip(pieces, starts, strict=True)]
    return Solid(np.concatenate([p.points for p in pieces]), np.concatenate(triangles))


def _parts(rows: NDArray[np.float64], time_s: float) -> Iterator[tuple[Look, Solid]]:
    flat = bool(np.any((rows[:, SHAPE] == BLOB) & (rows[:, MODE] == ATOP)))  # a sign's plates
    for row in rows:
        look = Look(Substance(int(row[SUBSTANCE])), float(row[ALBEDO]), float(row[EMIT]))
        if row[MODE] == SHADOW:
            continue
        if row[SHAPE] == FRUSTUM:
            corners = frustum(row, time_s)
            yield look, Solid(corners, _HULL)
            if row[PANE] > 0.0:
                yield _pane_look(look, float(row[PANE])), panes(corners)
        elif row[SHAPE] == WHEEL:
            yield look, wheel(row)
        else:
            yield look, plate(row) if flat else ball(row)


def _pane_look(look: Look, albedo: float) -> Look:
    """Cabins have windows; what else has panes has them painted on."""
    painted = look.substance is not Substance.CAR_PAINT
    return Look(look.substance, albedo) if painted else Look(Substance.GLASS, 0.03)


def frustum(row: Row, time_s: float) -> Points:
    """Its lower four corners, then its upper four, at a time."""
    angle = row[PHASE] + row[RATE] * time_s
    shift = (row[SWING] * np.sin(angle), row[LIFT] * max(0.0, np.cos(angle)))
    return np.concatenate(
        [_rectangle(row[LOW : LOW + 5], *shift), _rectangle(row[HIGH : HIGH + 5])]
    )


def _rectangle(numbers: Row, forward: float = 0.0, up: float = 0.0) -> Points:
    right, ahead, half_width, half_length, height = numbers
    corners = np.empty((4, 3))
    corners[:, 0] = right + SIGNS[:, 0] * half_width
    corners[:, 1] = height + up
    corners[:, 2] = ahead + forward + SIGNS[:, 1] * half_length
    return corners


def panes(corners: Points) -> Solid:
    """The windows on the four sides of a frustum."""
    middle = corners.mean(0)
    found = []
    for side in range(4):
        ahead = (side + 1) % 4
        quad = corners[[side, ahead, ahead + 4, side + 4]]
        normal = np.cross(quad[1] - quad[0], quad[3] - quad[0])
        normal *= STAND_OUT_M / max(float(np.linalg.norm(normal)), 1e-9)
        outwards = normal if normal @ (quad.mean(0) - middle) > 0.0 else -normal
        found.append(Solid(quad + PANE_INSET * (quad.mean(0) - quad) + outwards, QUAD))
    return joined(found)


def wheel(row: Row) -> Solid:
    """An upright disc, or a ring, that faces sideways."""
    right, ahead, radius, ring, up = row[LOW : LOW + 5]
    out = np.sign(right) * (STAND_OUT_M if row[MODE] != ATOP else 2.0 * STAND_OUT_M)
    inner = radius - ring if ring > 0.0 else 0.0
    across, along = _circle()
    points = [
        np.stack([np.full(ROUND, right + out), up + size * across, ahead + size * along], 1)
        for size in (radius, inner)
    ]
    return Solid(np.concatenate(points), _RING)


def plate(row: Row) -> Solid:
    """An upright disc that faces along the street; one atop of another stands out both ways."""
    right, ahead, radius, _, up = row[LOW : LOW + 5]
    out = (1.0 if row[MODE] != ATOP else 2.0) * STAND_OUT_M
    across, along = _circle()
    faces = []
    for side in (-out, out):
        rim = np.stack(
            [right + radius * along, up + radius * across, np.full(ROUND, ahead + side)], 1
        )
        centre = np.broadcast_to([right, up, ahead + side], (ROUND, 3))
        faces.append(Solid(np.concatenate([rim, centre]), _RING))
    return joined(faces)


def ball(row: Row) -> Solid:
    """A sphere, which is seen as a blob from everywhere."""
    right, ahead, radius, _, up = row[LOW : LOW + 5]
    return Solid(np.array([right, up, ahead]) + radius * _SPHERE.points, _SPHERE.triangles)


def _circle() -> tuple[Points, Points]:
    angle = 2.0 * np.pi * (np.arange(ROUND) + 0.5) / ROUND
    return np.sin(angle), np.cos(angle)


def _sphere(rings: int = 16) -> Solid:
    """A unit sphere of rings of triangles."""
    polar = np.pi * np.arange(rings + 1) / rings
    turn = 2.0 * np.pi * np.arange(ROUND) / ROUND
    points = np.stack(
        [
            np.outer(np.sin(polar), np.cos(turn)),
            np.outer(np.cos(polar), np.ones(ROUND)),
            np.outer(np.sin(polar), np.sin(turn)),
        ],
        axis=-1,
    )
    band = _band()
    triangles = np.concatenate([band + ring * ROUND for ring in range(rings)])
    return Solid(points.reshape(-1, 3), triangles)


def _band() -> Triangles:
    """Triangles between a circle of corners and the next."""
    here = np.arange(ROUND)
    beside = (here + 1) % ROUND
    lower = np.stack([here, beside, here + ROUND], 1)
    upper = np.stack([beside, beside + ROUND, here + ROUND], 1)
    return np.concatenate([lower, upper])


_SIDES = [[a, (a + 1) % 4, (a + 1) % 4 + 4, a + 4] for a in range(4)]
_HULL: Final[Triangles] = np.concatenate(
    [np.array(face)[QUAD] for face in [*_SIDES, [0, 1, 2, 3], [4, 5, 6, 7]]]
)
_RING: Final[Triangles] = _band()
_SPHERE: Final = _sphere()
