"""Where the light comes from: sky and sun, or street lamps and the headlights beside the camera."""

from __future__ import annotations

from typing import Final

import numpy as np

from eqs.scenes.light import BEAM, BEAM_REACH_M, LAMP_SPACING, POOL, SUN, SUN_X, SUN_Z
from eqs.scenes.plan import StreetPlan
from eqs.scenes.traced.materials import Plugin, spectrum
from eqs.scenes.traced.spectra import LAMP_K, SKY_K, SUN_K, Spectrum, glow
from eqs.scenes.traced.surroundings import mirrored

SUN_UP: Final = 0.8  # as painted faces are lit, see `face_light`
# Paths look for the sun more often than for the sky, which those that bounce find by themselves:
# a third of the noise of an even choice.
SUN_WEIGHT: Final = 4.0
LAMP_UP_M: Final = 5.75
POOLS: Final = range(-1, 6)  # street lamps that are lit, from the one behind the camera
BEAM_RAD: Final = 0.4  # half width of the headlights' beam, which fades within it


def sources(plan: StreetPlan) -> Plugin:
    """The lights of a street but for lamps that are seen themselves.

    A white surface that sees all of a source and faces it has the radiance that the plan gives in
    lux.
    """
    light = plan.light
    night = light[BEAM] > 0.0
    sky = plan.lighting.ambient_lux if night else float(plan.sky[:2].mean())
    found: Plugin = {"sky": {"type": "constant", "radiance": spectrum(sky * glow(SKY_K))}}
    if light[SUN] > 0.0:
        towards = np.array([light[SUN_X], SUN_UP, light[SUN_Z]])
        found["sun"] = {
            "type": "directional",
            "direction": (-mirrored(towards)).tolist(),
            "irradiance": spectrum(np.pi * light[SUN] * np.linalg.norm(towards) * glow(SUN_K)),
            "sampling_weight": SUN_WEIGHT,
        }
    if light[POOL] > 0.0:
        for number in POOLS:
            place = [0.0, LAMP_UP_M, number * light[LAMP_SPACING]]
            found[f"pool_{number}"] = {
                "type": "point", "position": place, "intensity": _seen(light[POOL], LAMP_UP_M)
            }  # fmt: skip
    if night:
        found["beam"] = {
            "type": "spot",
            "intensity": _seen(0.5 * light[BEAM], BEAM_REACH_M),
            "cutoff_angle": float(np.rad2deg(BEAM_RAD)),
            "beam_width": float(np.rad2deg(0.3 * BEAM_RAD)),
        }
    return found


def _seen(lux: float, distance_m: float) -> Plugin:
    """Intensity of a small lamp that gives a white surface so far away this radiance."""
    at: Spectrum = np.pi * lux * distance_m**2 * glow(LAMP_K)
    return spectrum(at)
