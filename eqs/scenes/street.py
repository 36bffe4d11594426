"""Draws one street: its light, its traffic and the way the camera drives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from eqs.scenes import actors as build
from eqs.scenes.actors import Actor
from eqs.scenes.light import (
    AMBIENT,
    BEAM,
    HAZE,
    HAZE_REACH,
    LAMP_SPACING,
    LIGHT_COLUMNS,
    POOL,
    SUN,
    SUN_X,
    SUN_Z,
)
from eqs.scenes.textures import HALF_STREET_M, KERB_M, LAMP_SPACING_M, Lighting

LANE_M: Final = 1.9
PARKING_M: Final = 5.1
EYE_M: Final = 1.5
PEDESTRIAN, RIDER, CAR, TRUCK = 0, 1, 2, 4  # DSEC-Detection class ids
TRUCK_SHARE: Final = 0.06  # of the vehicles


@dataclass(frozen=True, kw_only=True)
class Drive:
    """The camera's way: constant speed along the street plus sums of sinusoids.

    Args:
        speed: metres per second along the street.
        x: metres right of the middle of the street.
        waves: amplitude, rate (rad/s) and phase for each of
            (forward m, sideways m, height m, yaw rad, pitch rad, roll rad), shape (6, n, 3).
        yaw: constant yaw, radians to the right.
    """

    speed: float
    x: float
    waves: NDArray[np.float64]
    yaw: float = 0.0

    def pose(self, time_s: float) -> tuple[float, float, float, float, float, float]:
        """x, y, z in metres and yaw, pitch, roll in radians."""
        forward, side, up, yaw, pitch, roll = (
            self.waves[:, :, 0] * np.sin(self.waves[:, :, 1] * time_s + self.waves[:, :, 2])
        ).sum(1)
        return (
            self.x + side,
            EYE_M + up,
            self.speed * time_s + forward,
            self.yaw + yaw,
            pitch,
            roll,
        )


def _waves(rng: np.random.Generator, *, sway: float, shake: float) -> NDArray[np.float64]:
    """Slow and fast motion of the six axes, of these shares of a driving car's amplitudes."""
    # Amplitude and range of frequencies in Hz of the slow, then of the fast motion.
    table = {
        "forward": ((0.5, 0.15, 0.4), (0.0, 1.0, 2.0)),
        "side": ((0.25, 0.15, 0.4), (0.01, 1.5, 3.0)),
        "up": ((0.02, 1.0, 2.0), (0.012, 4.0, 8.0)),
        "yaw": ((0.07, 0.12, 0.35), (0.014, 1.5, 4.0)),
        "pitch": ((0.008, 1.0, 2.2), (0.008, 3.0, 7.0)),
        "roll": ((0.010, 0.6, 1.5), (0.006, 2.0, 6.0)),
    }

    def wave(size: float, low: float, high: float) -> tuple[float, float, float]:
        rate, phase = 2.0 * np.pi * rng.uniform(low, high), rng.uniform(0.0, 2.0 * np.pi)
        return size * rng.uniform(0.5, 1.3), rate, phase

    waves = np.array([[wave(*part) for part in parts] for parts in table.values()])
    waves[:, :, 0] *= (sway, shake)
    return waves


def draw_drive(rng: np.random.Generator, *, still: bool) -> Drive:
    """A drive along the right lane; a `still` one waits with the engine running."""
    speed = 0.0 if still else rng.uniform(2.0, 5.0)
    return Drive(
        speed=speed,
        x=LANE_M + rng.uniform(-0.3, 0.3),
        waves=_waves(rng, sway=0.12 if still else 1.0, shake=0.2 if still else 1.0),
        yaw=rng.uniform(-0.06, 0.06),
    )


def draw_lighting(rng: np.random.Generator, *, night: bool) -> Lighting:
    """Sunny, cloudy or night light, in lux at the focal plane of an f/2 lens."""
    side = float(rng.choice([-1.0, 1.0]))
    if night:
        lamp = rng.uniform(2.0, 5.0)
        return Lighting(
            ambient_lux=rng.uniform(0.25, 0.6),
            sun_lux=0.0,
            sun_side=side,
            lamp_lux=lamp,
            window_lux=rng.uniform(3.0, 9.0),
        )
    sunny = rng.random() < 0.6
    ambient = np.exp(rng.uniform(np.log(60.0), np.log(260.0)))
    return Lighting(
        ambient_lux=ambient,
        sun_lux=ambient * (rng.uniform(2.0, 4.0) if sunny else 0.15),
        sun_side=side,
        lamp_lux=0.0,
        window_lux=0.0,
    )


def light_vector(
    rng: np.random.Generator, lighting: Lighting, *, night: bool
) -> NDArray[np.float64]:
    """The light on actors, as the compiled code reads it."""
    light = np.zeros(LIGHT_COLUMNS)
    light[AMBIENT], light[SUN] = lighting.ambient_lux, lighting.sun_lux
    angle = rng.uniform(0.3, 1.2) * rng.choice([-1.0, 1.0])
    light[SUN_X], light[SUN_Z] = -lighting.sun_side * np.cos(angle), np.sin(angle)
    light[BEAM] = rng.uniform(5.0, 9.0) if night else 0.0
    light[POOL], light[LAMP_SPACING] = lighting.lamp_lux, LAMP_SPACING_M
    light[HAZE] = 0.03 * lighting.ambient_lux if night else 0.55 * lighting.ambient_lux
    light[HAZE_REACH] = rng.uniform(180.0, 400.0)
    return light


def _paint(rng: np.random.Generator, *, dark: float = 0.04, bright: float = 0.8) -> float:
    """A dark or a bright albedo, seldom one like the street's."""
    if rng.random() < 0.5:
        return float(rng.uniform(dark, 0.09))
    return float(rng.uniform(0.4, bright))


def _car(rng: np.random.Generator, *, lit: bool) -> NDArray[np.float64]:
    paint = _paint(rng)
    return build.car(
        paint,
        length=rng.uniform(3.9, 4.8),
        height=rng.uniform(1.42, 1.85),
        glass=0.04 if paint > 0.2 else rng.uniform(0.3, 0.5),  # bright glass mirrors the sky
        lit=lit,
    )


def _truck(rng: np.random.Generator, *, lit: bool) -> NDArray[np.float64]:
    return build.truck(_paint(rng), rng.uniform(0.55, 0.8), length=rng.uniform(5.8, 8.0), lit=lit)


def _pedestrian(rng: np.random.Generator, *, gait: float) -> NDArray[np.float64]:
    coat, trousers = rng.permutation([rng.uniform(0.03, 0.07), rng.uniform(0.45, 0.75)])
    return build.pedestrian(
        coat,
        trousers,
        height=rng.uniform(1.5, 1.92),
        gait=gait,
        phase=rng.uniform(0.0, 2.0 * np.pi),
    )


def _cyclist(rng: np.random.Generator, *, lit: bool) -> NDArray[np.float64]:
    return build.cyclist(
        _paint(rng),
        _paint(rng, bright=0.5),
        rng.uniform(0.05, 0.6),
        cadence=rng.uniform(5.0, 9.0),
        phase=rng.uniform(0.0, 2.0 * np.pi),
        lit=lit,
    )


def draw_furniture(rng: np.random.Generator, reach_m: float, *, night: bool) -> list[Actor]:
    """Lamps, trees, signs and bins along both pavements."""
    things = []
    for k in range(int(reach_m / LAMP_SPACING_M) + 1):
        side = 1.0 if k % 2 else -1.0
        parts = build.street_lamp(reach=-1.8 * side, lit=night)
        things.append(Actor(x=side * (KERB_M + 0.4), z=k * LAMP_SPACING_M, parts=parts))
    share = rng.uniform(0.01, 0.04)
    for z in np.arange(3.0, reach_m, 4.0):
        for side in (-1.0, 1.0):
            kind, x = rng.random() / share, side * (KERB_M + rng.uniform(0.4, 0.9))
            at = z + rng.uniform(-1.5, 1.5)
            if kind < 1.0:
                parts = build.tree(rng.uniform(0.08, 0.2), height=rng.uniform(3.5, 6.5))
            elif kind < 1.6:
                parts = build.sign(rng.uniform(0.4, 0.85))
            elif kind < 2.4:
                parts = build.bin_box(_paint(rng))
                x = side * rng.uniform(KERB_M + 0.5, HALF_STREET_M - 0.5)
            else:
                continue
            things.append(Actor(x=x, z=at, parts=parts))
    return things


def draw_vehicles(
    rng: np.random.Generator, drive: Drive, way_m: float, *, night: bool
) -> list[Actor]:
    """Parked, leading and oncoming cars and trucks."""
    found = []

    def add(x: float, z: float, *, speed: float = 0.0, heading: float = 0.0, lit: bool) -> None:
        heavy = rng.random() < TRUCK_SHARE
        parts = _truck(rng, lit=lit) if heavy else _car(rng, lit=lit)
        label = TRUCK if heavy else CAR
        found.append(Actor(x=x, z=z, speed=speed, heading=heading, label=label, parts=parts))

    for side, heading in ((1.0, 0.0), (-1.0, np.pi)):
        share, z = rng.uniform(0.03, 0.25), rng.uniform(2.0, 10.0)
        while z < way_m + 13.0:
            if rng.random() < share:
                add(side * (PARKING_M + rng.uniform(-0.12, 0.12)), z, heading=heading, lit=False)
            z += 8.6 if rng.random() < share else 6.2
    if rng.random() < 0.25:
        speed = max(0.0, drive.speed + rng.choice([-1.0, 1.0]) * rng.uniform(0.7, 1.5))
        add(drive.x, rng.uniform(8.0, 15.0), speed=speed, lit=night)
    z = rng.uniform(10.0, 28.0)
    for _ in range(rng.integers(0, 3)):
        add(-LANE_M + rng.uniform(-0.2, 0.2), z, speed=6.0, heading=np.pi, lit=night)
        z += rng.uniform(9.0, 30.0)
    return found


def _ahead(rng: np.random.Generator, way_m: float) -> float:
    """Somewhere along the way, or little beyond: farther people show, but too small for a box."""
    return rng.uniform(5.0, way_m + 9.0)


def draw_pedestrians(rng: np.random.Generator, way_m: float) -> list[Actor]:
    """People on the pavements, beside parked cars and crossing the street."""
    found = []

    def add(x: float, speed: float, heading: float) -> None:
        parts, z = _pedestrian(rng, gait=speed * 4.6), _ahead(rng, way_m)
        found.append(Actor(x=x, z=z, speed=speed, heading=heading, label=PEDESTRIAN, parts=parts))

    for _ in range(rng.integers(1, 4)):
        walking = rng.random() < 0.8
        beside = rng.random() < 0.4  # on the road beside the parked cars
        x = rng.uniform(3.6, 4.2) if beside else rng.uniform(KERB_M + 0.3, HALF_STREET_M - 0.8)
        heading = float(rng.choice([0.0, np.pi])) + rng.uniform(-0.8, 0.8)
        add(x * rng.choice([-1.0, 1.0]), rng.uniform(1.0, 1.8) if walking else 0.0, heading)
    for _ in range(rng.integers(0, 3)):
        side = rng.choice([-1.0, 1.0])
        add(side * rng.uniform(1.0, KERB_M), rng.uniform(1.0, 1.9), -side * np.pi / 2)
    return found


def draw_cyclists(rng: np.random.Generator, way_m: float, *, night: bool) -> list[Actor]:
    """Cyclists who cross the street: seen from ahead they would look like pedestrians."""
    found = []
    for _ in range(rng.integers(1, 4)):
        side = float(rng.choice([-1.0, 1.0]))
        found.append(
            Actor(
                x=-side * rng.uniform(0.0, 10.0),
                z=_ahead(rng, way_m),
                speed=rng.uniform(2.0, 5.0),
                heading=side * (0.5 * np.pi + rng.uniform(-0.6, 0.6)),
                label=RIDER,
                parts=_cyclist(rng, lit=night),
            )
        )
    return found
