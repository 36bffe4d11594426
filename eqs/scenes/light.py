"""The light that falls on an actor: sky, sun, headlights and street lamps."""

from __future__ import annotations

import math
from typing import Final

from eqs.kernels import njit
from eqs.scenes.optics import CAM_COS, CAM_SIN, CAM_X, CAM_Z, Array

Lit = tuple[float, float, float, float]  # direction to the camera (x, z), headlights, lamps
BEAM_REACH_M: Final = 14.0  # depth at which headlights have lost half their effect
LAMP_POOL_M: Final = 7.0  # half width of the pool of light under a street lamp

# Columns of a light vector: illuminance of a white surface at the focal plane, in lux; the sun's
# horizontal direction; whether it is night; spacing of street lamps; radiance of the haze.
AMBIENT, SUN, SUN_X, SUN_Z, BEAM, POOL, LAMP_SPACING, HAZE, HAZE_REACH = range(9)
LIGHT_COLUMNS: Final = 9


@njit(cache=True, error_model="numpy")
def local_light(x: float, z: float, depth: float, camera: Array, light: Array) -> Lit:
    """Where the camera is seen from (x, z), and the light of its beam and of the lamps there."""
    dx, dz = camera[CAM_X] - x, camera[CAM_Z] - z
    distance = max(math.sqrt(dx * dx + dz * dz), 1e-3)
    beside = (dx * camera[CAM_COS] - dz * camera[CAM_SIN]) / (0.4 * depth + 1.0)
    beam = light[BEAM] * math.exp(-beside * beside) / (1.0 + (depth / BEAM_REACH_M) ** 2)
    gap = z - light[LAMP_SPACING] * math.floor(z / light[LAMP_SPACING] + 0.5)
    pool = light[POOL] * math.exp(-((gap / LAMP_POOL_M) ** 2))
    return dx / distance, dz / distance, beam, pool


@njit(cache=True, error_model="numpy")
def face_light(nx: float, nz: float, up: float, light: Array, lit: Lit) -> float:
    """Illuminance of a face; `lit` is view direction x, z, then beam and lamp light here."""
    sun = max(0.0, nx * light[SUN_X] + nz * light[SUN_Z]) + 0.8 * up
    towards = max(0.2, nx * lit[0] + nz * lit[1])
    return light[AMBIENT] + light[SUN] * sun + lit[2] * towards + lit[3] * (0.5 + 0.5 * up)
