"""Draws one street: its light, its surfaces, its traffic and the way the camera drives."""

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
from eqs.scenes.paint_street import Surfaces
from eqs.scenes.textures import (
    HALF_STREET_M,
    KERB_M,
    LAMP_SPACING_M,
    Lighting,
    front,
    ground,
    integrate,
)

LANE_M: Final = 1.9
PARKING_M: Final = 5.1
EYE_M: Final = 1.5
PEDESTRIAN, RIDER, CAR, TRUCK = 0, 1, 2, 4  # DSEC-Detection class ids


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
    speed = 0.0 if still else rng.uniform(3.0, 8.0)
    return Drive(
        speed=speed,
        x=LANE_M + rng.uniform(-0.3, 0.3),
        waves=_waves(rng, sway=0.12 if still else 1.0, shake=0.5 if still else 1.0),
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


def draw_surfaces(
    rng: np.random.Generator, lighting: Lighting, texel_m: float, *, night: bool
) -> Surfaces:
    """Both fronts, the ground and the sky."""
    left, left_roofs = front(rng, lighting, -1.0, texel_m)
    right, right_roofs = front(rng, lighting, 1.0, texel_m)
    road = ground(rng, lighting, texel_m, (left_roofs, right_roofs))
    sky = lighting.ambient_lux * (0.02 if night else rng.uniform(0.7, 1.3))
    roofs = np.zeros((len(left_roofs) + 1, 2))
    roofs[1:] = np.cumsum(np.stack([left_roofs, right_roofs], axis=1), axis=0) / texel_m
    contrast = 0.05 if night else rng.uniform(0.05, 0.2)
    return Surfaces(
        road=integrate(road.T),
        left=integrate(left.T),
        right=integrate(right.T),
        roofs=roofs,
        sky=np.array([1.2 * sky, 0.8 * sky, contrast]),
        texels_per_m=1.0 / texel_m,
        half_street_m=HALF_STREET_M,
    )


def _paint(rng: np.random.Generator, *, dark: float = 0.04, bright: float = 0.8) -> float:
    """A dark or a bright albedo, seldom one like the street's."""
    if rng.random() < 0.5:
        return float(rng.uniform(dark, 0.09))
    return float(rng.uniform(0.4, bright))


def _car(rng: np.random.Generator, *, lit: bool) -> NDArray[np.float64]:
    return build.car(
        _paint(rng),
        length=rng.uniform(3.9, 4.8),
        height=rng.uniform(1.42, 1.85),
        glass=float(rng.choice([0.03, 0.06, 0.3])),
        lit=lit,
    )


def _truck(rng: np.random.Generator, *, lit: bool) -> NDArray[np.float64]:
    return build.truck(_paint(rng), rng.uniform(0.25, 0.8), length=rng.uniform(5.8, 8.0), lit=lit)


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
    for side, heading in ((1.0, 0.0), (-1.0, np.pi)):
        share, z = rng.uniform(0.02, 0.2), rng.uniform(2.0, 10.0)
        while z < way_m + 18.0:
            if rng.random() < share:
                heavy = rng.random() < 0.08
                parts = _truck(rng, lit=False) if heavy else _car(rng, lit=False)
                x = side * (PARKING_M + rng.uniform(-0.12, 0.12))
                label = TRUCK if heavy else CAR
                found.append(Actor(x=x, z=z, heading=heading, label=label, parts=parts))
            z += 8.6 if rng.random() < share else 6.2
    if rng.random() < 0.25:
        heavy = rng.random() < 0.1
        parts = _truck(rng, lit=night) if heavy else _car(rng, lit=night)
        speed = max(0.0, drive.speed + rng.choice([-1.0, 1.0]) * rng.uniform(1.0, 2.5))
        label = TRUCK if heavy else CAR
        found.append(
            Actor(x=drive.x, z=rng.uniform(9.0, 24.0), speed=speed, label=label, parts=parts)
        )
    z = rng.uniform(12.0, 34.0)
    for _ in range(rng.integers(0, 3)):
        heavy = rng.random() < 0.12
        parts = _truck(rng, lit=night) if heavy else _car(rng, lit=night)
        x, label = -LANE_M + rng.uniform(-0.2, 0.2), TRUCK if heavy else CAR
        found.append(Actor(x=x, z=z, speed=8.0, heading=np.pi, label=label, parts=parts))
        z += rng.uniform(9.0, 35.0)
    return found


def draw_people(
    rng: np.random.Generator, drive: Drive, way_m: float, *, night: bool
) -> list[Actor]:
    """Pedestrians on the pavements and crossing, and cyclists."""
    found = []
    for _ in range(rng.integers(1, 4)):
        walking = rng.random() < 0.8
        speed = rng.uniform(1.0, 1.8) if walking else 0.0
        heading = float(rng.choice([0.0, np.pi])) + rng.uniform(-0.1, 0.1)
        beside = rng.random() < 0.4  # on the road beside the parked cars
        x = rng.uniform(3.6, 4.2) if beside else rng.uniform(KERB_M + 0.3, HALF_STREET_M - 0.8)
        x *= rng.choice([-1.0, 1.0])
        z = rng.uniform(5.0, way_m + 8.0)
        parts = _pedestrian(rng, gait=speed * 4.6)
        found.append(Actor(x=x, z=z, speed=speed, heading=heading, label=PEDESTRIAN, parts=parts))
    for _ in range(rng.integers(0, 3)):
        side, speed = rng.choice([-1.0, 1.0]), rng.uniform(1.0, 1.9)
        x, z = side * rng.uniform(1.0, KERB_M), way_m + rng.uniform(4.0, 10.0)
        parts = _pedestrian(rng, gait=speed * 4.6)
        found.append(
            Actor(x=x, z=z, speed=speed, heading=-side * np.pi / 2, label=PEDESTRIAN, parts=parts)
        )
    for _ in range(rng.integers(1, 4)):
        speed, kind = rng.uniform(3.0, 6.5), rng.random()
        parts = _cyclist(rng, lit=night)
        if kind < 0.25:
            x, z, heading = rng.uniform(3.1, 3.9), rng.uniform(5.0, 0.7 * way_m + 7.0), 0.0
        elif kind < 0.4:
            x, z, heading = -rng.uniform(2.4, 3.4), rng.uniform(10.0, way_m + 20.0), np.pi
        else:
            heading = float(rng.choice([-1.0, 1.0])) * np.pi / 2
            x = -np.sign(heading) * rng.uniform(2.0, 12.0)
            z = way_m * rng.uniform(0.3, 1.0) + rng.uniform(5.0, 10.0)
        found.append(Actor(x=x, z=z, speed=speed, heading=heading, label=RIDER, parts=parts))
    return found
