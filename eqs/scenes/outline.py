"""Compiled step from actors to painted polygons in image coordinates at one instant."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from eqs.kernels import njit
from eqs.scenes.light import HAZE, HAZE_REACH, Lit, face_light, local_light
from eqs.scenes.optics import (
    CAM_COS,
    CAM_SIN,
    CAM_X,
    CAM_Z,
    FOCAL,
    MID_COLUMN,
    Array,
    convex_hull,
    project,
    signed_area,
)
from eqs.scenes.parts import (
    ALBEDO,
    ANY,
    ATOP,
    BACK,
    DEPTH_SORT,
    EMIT,
    FRONT,
    FRUSTUM,
    HEADING,
    HIGH,
    LIFT,
    LOW,
    MODE,
    PANE,
    PHASE,
    RATE,
    RIGHT,
    SEEN_FROM,
    SHADOW,
    SHAPE,
    SOLID,
    SPEED,
    SWING,
    WHEEL,
    X,
    Z,
)
from eqs.scenes.polygons import CORNERS, Polygons, store

FAR_M: Final = 110.0
REACH_M: Final = 5.0  # no part of an actor is farther from its middle
PANE_INSET: Final = 0.18


@njit(cache=True, error_model="numpy")
def _hidden_side(seen_from: float, heading: float, lit: Lit) -> bool:
    if seen_from == ANY:
        return False
    along = math.sin(heading) * lit[0] + math.cos(heading) * lit[1]
    across = math.cos(heading) * lit[0] - math.sin(heading) * lit[1]
    if seen_from == FRONT:
        return along <= 0.0
    if seen_from == BACK:
        return along >= 0.0
    return across <= 0.0 if seen_from == RIGHT else across >= 0.0


@njit(cache=True, error_model="numpy")
def _corners_of(
    part: Array, x: float, z: float, heading: float, time_s: float, camera: Array, corners: Array
) -> float:
    """Project a frustum's eight corners; returns the depth of the last one."""
    sine, cosine = math.sin(heading), math.cos(heading)
    depth = 1.0
    angle = part[PHASE] + part[RATE] * time_s
    for level in range(2):
        at = LOW if level == 0 else HIGH
        right, forward, up = part[at], part[at + 1], part[at + 4]
        if level == 0:
            forward += part[SWING] * math.sin(angle)
            up += part[LIFT] * max(0.0, math.cos(angle))
        for corner in range(4):
            r = right + (part[at + 2] if corner in (1, 2) else -part[at + 2])
            f = forward + (part[at + 3] if corner in (2, 3) else -part[at + 3])
            wx, wz = x + r * cosine + f * sine, z - r * sine + f * cosine
            depth = project(wx, up, wz, camera, corners[4 * level + corner])
    return depth


@njit(cache=True, error_model="numpy")
def _disc_corners(
    part: Array, x: float, z: float, heading: float, camera: Array, corners: Array
) -> float:
    sine, cosine = math.sin(heading), math.cos(heading)
    cx = x + part[LOW] * cosine + part[LOW + 1] * sine
    cz = z - part[LOW] * sine + part[LOW + 1] * cosine
    if part[SHAPE] == WHEEL:
        ax, az = sine, cosine
    else:
        ax, az = camera[CAM_COS], -camera[CAM_SIN]
    radius, depth = part[LOW + 2], 1.0
    for k in range(CORNERS):
        angle = (k + 0.5) * math.pi / 4.0
        c, s = radius * math.cos(angle), radius * math.sin(angle)
        depth = project(cx + c * ax, part[LOW + 4] + s, cz + c * az, camera, corners[k])
    return depth


@njit(cache=True, error_model="numpy")
def _add_faces(
    polygons: Polygons,
    used: int,
    part: Array,
    heading: float,
    camera: Array,
    light: Array,
    lit: Lit,
    fade: float,
) -> int:
    """Paint the visible faces of the frustum whose corners lie in the scratch space."""
    sine, cosine = math.sin(heading), math.cos(heading)
    corners, quad = polygons.scratch[0], polygons.scratch[2]
    for face in range(5):
        side = (0.0, 1.0, 0.0, -1.0, 0.0)[face]
        along = (-1.0, 0.0, 1.0, 0.0, 0.0)[face]
        a, b = face, (face + 1) % 4
        order = (a, b, b + 4, a + 4) if face < 4 else (4, 5, 6, 7)
        for i in range(4):
            quad[i, 0], quad[i, 1] = corners[order[i], 0], corners[order[i], 1]
        if signed_area(quad, 4) >= 0.0:  # seen from inside
            continue
        nx, nz = side * cosine + along * sine, along * cosine - side * sine
        shade = fade * face_light(nx, nz, 1.0 if face == 4 else 0.0, light, lit)
        haze = (1.0 - fade) * light[HAZE]
        colour = part[ALBEDO] * shade + haze
        used = store(polygons, used, quad, 4, ATOP, colour, 0.0, 1.0, camera)
        if part[PANE] > 0.0 and face < 4:
            mx = 0.25 * (quad[0, 0] + quad[1, 0] + quad[2, 0] + quad[3, 0])
            my = 0.25 * (quad[0, 1] + quad[1, 1] + quad[2, 1] + quad[3, 1])
            for i in range(4):
                quad[i, 0] += PANE_INSET * (mx - quad[i, 0])
                quad[i, 1] += PANE_INSET * (my - quad[i, 1])
            colour = part[PANE] * shade + haze
            used = store(polygons, used, quad, 4, ATOP, colour, 0.0, 1.0, camera)
    return used


@njit(cache=True, error_model="numpy")
def _add_part(
    polygons: Polygons,
    used: int,
    part: Array,
    x: float,
    z: float,
    heading: float,
    time_s: float,
    camera: Array,
    light: Array,
    lit: Lit,
    fade: float,
) -> int:
    corners, outline, points = polygons.scratch[0], polygons.scratch[1], polygons.scratch[3]
    ring_px = 0.0
    if part[SHAPE] == FRUSTUM:
        _corners_of(part, x, z, heading, time_s, camera, corners)
        points[:CORNERS] = corners[:CORNERS]
        count = convex_hull(points, CORNERS, outline)
    else:
        depth = _disc_corners(part, x, z, heading, camera, corners)
        outline[:CORNERS] = corners[:CORNERS]
        ring_px = camera[FOCAL] * part[LOW + 3] / depth
        count = CORNERS
    if part[MODE] == SHADOW:
        return store(polygons, used, outline, count, SHADOW, 0.0, 0.0, part[ALBEDO], camera)
    shade = 0.8 * face_light(lit[0], lit[1], 0.0, light, lit)
    colour = fade * (part[ALBEDO] * shade + part[EMIT]) + (1.0 - fade) * light[HAZE]
    before = used
    mode = SOLID if part[MODE] == SOLID else ATOP
    used = store(polygons, used, outline, count, mode, colour, ring_px, 1.0, camera)
    if used > before and part[SHAPE] == FRUSTUM and part[PANE] >= 0.0:
        used = _add_faces(polygons, used, part, heading, camera, light, lit, fade)
    return used


@njit(cache=True, error_model="numpy")
def _grow_box(box: Array, corners: Array) -> None:
    for i in range(CORNERS):
        box[0], box[2] = min(box[0], corners[i, 0]), max(box[2], corners[i, 0])
        box[1], box[3] = min(box[1], corners[i, 1]), max(box[3], corners[i, 1])


@njit(cache=True, error_model="numpy")
def _add_actor(
    polygons: Polygons,
    used: int,
    box: Array,
    actor: Array,
    parts: Array,
    time_s: float,
    camera: Array,
    light: Array,
) -> int:
    """Add one actor's parts and grow its box, unless it is out of sight."""
    heading = actor[HEADING]
    x = actor[X] + actor[SPEED] * time_s * math.sin(heading)
    z = actor[Z] + actor[SPEED] * time_s * math.cos(heading)
    dx, dz = x - camera[CAM_X], z - camera[CAM_Z]
    depth = dx * camera[CAM_SIN] + dz * camera[CAM_COS]
    actor[DEPTH_SORT] = -depth
    beside = abs(dx * camera[CAM_COS] - dz * camera[CAM_SIN])
    widest = depth * camera[MID_COLUMN] / camera[FOCAL] + 1.5 * REACH_M
    if not -REACH_M < depth < FAR_M or beside > widest:
        return used
    lit = local_light(x, z, max(depth, 0.5), camera, light)
    fade = light[HAZE_REACH] / (light[HAZE_REACH] + max(depth, 0.0))
    for p in range(len(parts)):
        part = parts[p]
        if used + 12 > len(polygons.marks) or _hidden_side(part[SEEN_FROM], heading, lit):
            continue
        used = _add_part(polygons, used, part, x, z, heading, time_s, camera, light, lit, fade)
        if part[MODE] == SOLID:
            _grow_box(box, polygons.scratch[0])
    return used


@njit(cache=True, error_model="numpy")
def outline_actors(
    polygons: Polygons,
    actors: Array,
    parts: Array,
    first: NDArray[np.int64],
    time_s: float,
    camera: Array,
    light: Array,
) -> int:
    """Fill `polygons` with everything that may be seen at `time_s`; returns how many there are.

    Args:
        polygons: storage, overwritten.
        actors: actor rows, shape (n, ACTOR_COLUMNS); the sorting column is overwritten.
        parts: part rows of all actors, one actor after the other.
        first: index of each actor's first part, and the total, shape (n + 1,).
        time_s: seconds since the start of the world.
        camera: camera vector.
        light: light vector.
    """
    used = 0
    for i in range(len(actors)):
        box = polygons.boxes[i]
        box[0], box[1], box[2], box[3] = 1e9, 1e9, -1e9, -1e9
        polygons.spans[i, 0] = used
        own = parts[first[i] : first[i + 1]]
        used = _add_actor(polygons, used, box, actors[i], own, time_s, camera, light)
        polygons.spans[i, 1] = used
    polygons.order[:] = np.argsort(actors[:, DEPTH_SORT])
    return used
