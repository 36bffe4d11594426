"""What stands still around the actors: ground, building fronts, houses behind them."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from eqs.scenes.plan import StreetPlan
from eqs.scenes.substances import Substance
from eqs.scenes.textures import (
    HALF_STREET_M,
    HEDGE_M,
    KERB_M,
    PERIOD_M,
    Front,
    Ground,
)
from eqs.scenes.traced.engine import engine
from eqs.scenes.traced.materials import PANE_ALBEDO, Plugin, mixed, surface, textured
from eqs.scenes.traced.shapes import QUAD

Points = NDArray[np.float64]

BEHIND_M: Final = -48.0  # where the street begins and ends: beyond, both vanish into the horizon
AHEAD_M: Final = 240.0
DEEP_M: Final = 8.0  # of a building
BRICK_BELOW: Final = 0.27  # albedo: darker fronts are of brick, brighter ones of plaster
EARTH_ALBEDO: Final = 0.15


def mirrored(points: Points) -> Points:
    """World points for the tracer, whose axes are right-handed: x to the left, y up, z along."""
    return points * (-1.0, 1.0, 1.0)


def mesh(
    name: str,
    points: Points,
    triangles: NDArray[np.int64],
    parts: Plugin,
    uv: Points | None = None,
) -> Any:  # noqa: ANN401 - a library without types
    """A mesh of the tracer, with flat faces.

    Args:
        name: by which it is found again.
        points: corners in the world, shape (n, 3).
        triangles: numbers of corners, shape (m, 3).
        parts: descriptions of its surface and of what else it has.
        uv: where the corners lie on textures, shape (n, 2).
    """
    mi = engine()
    properties = mi.Properties()
    properties["face_normals"] = True
    for key, description in parts.items():
        properties[key] = mi.load_dict(description)
    made = mi.Mesh(
        name, len(points), len(triangles), props=properties, has_vertex_texcoords=uv is not None
    )
    data = mi.traverse(made)
    data["vertex_positions"] = mirrored(points).astype(np.float32).ravel()
    data["faces"] = triangles.astype(np.uint32).ravel()
    if uv is not None:
        data["vertex_texcoords"] = uv.astype(np.float32).ravel()
    data.update()
    made.set_id(name)
    return made


def ground_meshes(plan: StreetPlan) -> Iterator[Any]:
    """Road, pavements, and the earth around them."""
    road, texel_m = plan.ground, plan.texel_m
    strips = {
        "pavement_left": (-HALF_STREET_M, -KERB_M, Substance.PAVING),
        "road": (-KERB_M, KERB_M, Substance.ASPHALT),
        "pavement_right": (KERB_M, HALF_STREET_M, Substance.PAVING),
    }
    for name, (left, right, substance) in strips.items():
        rows = slice(*(round((x + HALF_STREET_M) / texel_m) for x in (left, right)))
        part = Ground(albedo=road.albedo[rows], white=road.white[rows])
        edges = (rows.start * texel_m - HALF_STREET_M, rows.stop * texel_m - HALF_STREET_M)
        yield _floor(name, edges, 0.0, {"bsdf": _paved(part, substance)})
    earth = {"bsdf": surface(Substance.EARTH, EARTH_ALBEDO)}
    yield _floor("earth", (-2000.0, 2000.0), -0.05, earth, (-2000.0, 2000.0))


def _paved(part: Ground, substance: Substance) -> Plugin:
    below = textured(substance, part.albedo, ~part.white)
    if not part.white.any():
        return below
    paint = textured(Substance.WHITE_PAINT, part.albedo, part.white)
    return mixed(below, paint, part.white)


def _floor(
    name: str,
    x: tuple[float, float],
    y: float,
    parts: Plugin,
    z: tuple[float, float] = (BEHIND_M, AHEAD_M),
) -> Any:  # noqa: ANN401
    """A level rectangle whose u counts periods along the street, and v its width."""
    corners = np.array([[x[0], y, z[0]], [x[1], y, z[0]], [x[1], y, z[1]], [x[0], y, z[1]]])
    along = np.array(z) / PERIOD_M
    uv = np.array([[along[0], 0.0], [along[0], 1.0], [along[1], 1.0], [along[1], 0.0]])
    return mesh(name, corners, QUAD, parts, uv)


def buildings(plan: StreetPlan) -> Iterator[Any]:
    """Both rows of houses, walls and hedges, as often as they repeat."""
    periods = range(int(np.floor(BEHIND_M / PERIOD_M)), int(np.ceil(AHEAD_M / PERIOD_M)))
    for side, row in ((-1.0, plan.left), (1.0, plan.right)):
        edges = [0, *(np.flatnonzero(np.diff(row.roofs)) + 1).tolist(), len(row.roofs)]
        for start, stop in pairwise(edges):
            front, body = _house(row, start, stop, plan.texel_m)
            roof_m = float(row.roofs[start])
            for period in periods:
                z = (
                    start * plan.texel_m + period * PERIOD_M,
                    stop * plan.texel_m + period * PERIOD_M,
                )
                name = f"house_{side:+.0f}_{start}_{period}"
                yield _wall(f"{name}_front", side, z, roof_m, {"bsdf": front})
                yield _block(f"{name}_body", side, z, roof_m, {"bsdf": body})


def _house(row: Front, start: int, stop: int, texel_m: float) -> tuple[Plugin, Plugin]:
    """Surfaces of a house's front and of the rest of it."""
    roof_m = float(row.roofs[start])
    tall = max(1, round(roof_m / texel_m))
    albedo, glass = row.albedo[:tall, start:stop], row.glass[:tall, start:stop]
    mean = float(albedo[~glass].mean())
    substance = Substance.BRICK if mean < BRICK_BELOW else Substance.PLASTER
    if roof_m <= HEDGE_M:
        substance = Substance.FOLIAGE
    front = textured(substance, albedo, ~glass)
    if glass.any():
        front = mixed(front, surface(Substance.GLASS, PANE_ALBEDO), glass)
    return front, surface(substance, mean)


def _wall(name: str, side: float, z: tuple[float, float], roof_m: float, parts: Plugin) -> Any:  # noqa: ANN401
    x = side * HALF_STREET_M
    corners = np.array([[x, 0.0, z[0]], [x, 0.0, z[1]], [x, roof_m, z[1]], [x, roof_m, z[0]]])
    uv = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    return mesh(name, corners, QUAD, parts, uv)


def _block(name: str, side: float, z: tuple[float, float], roof_m: float, parts: Plugin) -> Any:  # noqa: ANN401
    """The house behind its front, whose gables are seen over lower neighbours."""
    x = side * (HALF_STREET_M + np.array([0.02, DEEP_M]))
    low = np.array([[x[0], 0.0, z[0]], [x[1], 0.0, z[0]], [x[1], 0.0, z[1]], [x[0], 0.0, z[1]]])
    corners = np.concatenate([low, low + np.array([0.0, roof_m, 0.0])])
    sides = [[a, (a + 1) % 4, (a + 1) % 4 + 4, a + 4] for a in range(4)]
    faces = np.concatenate([np.array(face)[QUAD] for face in [*sides, [4, 5, 6, 7]]])
    return mesh(name, corners, faces, parts)
