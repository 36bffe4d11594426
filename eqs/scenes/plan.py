"""All that is drawn of one street, before anything is painted or traced."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from eqs.scenes import street as draw
from eqs.scenes.actors import Actor
from eqs.scenes.paint_street import Surfaces
from eqs.scenes.textures import (
    HALF_STREET_M,
    Front,
    Ground,
    Lighting,
    front,
    front_radiance,
    ground,
    ground_radiance,
    integrate,
)

TEXEL_M: Final = (0.03125, 0.125)  # finest and coarsest texture


@dataclass(frozen=True, kw_only=True)
class Street:
    """What a street and the drive along it are drawn from.

    Args:
        seed: integers that name it.
        night: street lamps, lit windows and headlights instead of daylight.
        still: the camera waits instead of driving.
        duration_s: for how long there shall be something to see.
    """

    seed: tuple[int, ...]
    night: bool = False
    still: bool = False
    duration_s: float = 3.0


@dataclass(frozen=True, kw_only=True, eq=False)
class StreetPlan:
    """One street: its light, what stands and moves in it, and the way the camera drives.

    Args:
        lighting: where the light comes from.
        light: the same for actors, a light vector.
        drive: the camera's way.
        left: building fronts on the left.
        right: and on the right.
        ground: road and pavements.
        sky: radiance in lux at the horizon and at 45 degrees, cloud contrast, shape (3,).
        texel_m: size of the textures' texels.
        actors: labelled ones and others.
    """

    lighting: Lighting
    light: NDArray[np.float64]
    drive: draw.Drive
    left: Front
    right: Front
    ground: Ground
    sky: NDArray[np.float64]
    texel_m: float
    actors: list[Actor]


def draw_plan(street: Street, width: int) -> StreetPlan:
    """Draw a street; the width of the image, in pixels, sets the resolution of the textures."""
    rng = np.random.default_rng(np.random.SeedSequence(tuple(street.seed)))
    night = street.night
    lighting = draw.draw_lighting(rng, night=night)
    light = draw.light_vector(rng, lighting, night=night)
    drive = draw.draw_drive(rng, still=street.still)
    texel_m = float(np.clip(TEXEL_M[1] * 128.0 / width, *TEXEL_M))
    left, right = front(rng, lighting, texel_m), front(rng, lighting, texel_m)
    road = ground(rng, texel_m)
    sky = _draw_sky(rng, lighting, night=night)
    way_m = drive.speed * street.duration_s
    return StreetPlan(
        lighting=lighting,
        light=light,
        drive=drive,
        left=left,
        right=right,
        ground=road,
        sky=sky,
        texel_m=texel_m,
        actors=[
            *draw.draw_furniture(rng, way_m + 80.0, night=night),
            *draw.draw_vehicles(rng, drive, way_m, night=night),
            *draw.draw_pedestrians(rng, way_m),
            *draw.draw_cyclists(rng, way_m, night=night),
        ],
    )


def painted_surfaces(plan: StreetPlan) -> Surfaces:
    """Both fronts, the ground and the sky, lit, as the compiled painter reads them."""
    roofs = (plan.left.roofs, plan.right.roofs)
    heights = np.zeros((len(roofs[0]) + 1, 2))
    heights[1:] = np.cumsum(np.stack(roofs, axis=1), axis=0) / plan.texel_m
    road = ground_radiance(plan.ground, plan.lighting, plan.texel_m, roofs)
    return Surfaces(
        road=integrate(road.T),
        left=integrate(front_radiance(plan.left, plan.lighting, -1.0, plan.texel_m).T),
        right=integrate(front_radiance(plan.right, plan.lighting, 1.0, plan.texel_m).T),
        roofs=heights,
        sky=plan.sky,
        texels_per_m=1.0 / plan.texel_m,
        half_street_m=HALF_STREET_M,
    )


def _draw_sky(rng: np.random.Generator, lighting: Lighting, *, night: bool) -> NDArray[np.float64]:
    sky = lighting.ambient_lux * (0.15 if night else rng.uniform(0.7, 1.3))
    contrast = 0.05 if night else rng.uniform(0.05, 0.2)
    return np.array([1.2 * sky, 0.8 * sky, contrast])
