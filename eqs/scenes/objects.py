"""Scenes that are no street: shapes that pass and turn before a texture, a moving camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from eqs.scenes.paint_objects import OBJECT_COLUMNS, paint_objects, radius_at
from eqs.scenes.world import ActorsInView

TEXTURE_SIDE: Final = 512
SHAPES: Final = ("disc", "box", "star", "cross")
"""What objects there are; their number is the shape's, and their label `FIRST_LABEL` more."""
FIRST_LABEL: Final = 8  # after the classes of DSEC-Detection
OUTLINE: Final = 2.0 * np.pi * np.arange(96) / 96


@dataclass(frozen=True, kw_only=True)
class Swing:
    """A smooth motion: a constant velocity and sums of sines, analytic in time.

    Args:
        start: value at time zero.
        per_s: constant change per second.
        amplitudes: of the sines.
        rates_hz: of the sines.
        phases: of the sines, radian.
    """

    start: float
    per_s: float = 0.0
    amplitudes: tuple[float, ...] = ()
    rates_hz: tuple[float, ...] = ()
    phases: tuple[float, ...] = ()

    def at(self, t_s: float) -> float:
        """The value at a time in seconds."""
        waves = zip(self.amplitudes, self.rates_hz, self.phases, strict=True)
        swings = sum(a * np.sin(2.0 * np.pi * f * t_s + phase) for a, f, phase in waves)
        return float(self.start + self.per_s * t_s + swings)


@dataclass(frozen=True, kw_only=True)
class Manner:
    """How much moves in a scene, how bright it is and whether its light flickers.

    Lengths are shares of the image's height.

    Args:
        camera_shift: how far the camera swings.
        camera_turn_rad: how far it turns about its axis.
        camera_pan_per_s: most that it moves on per second.
        objects: least and largest number of objects.
        object_speed: most that an object moves per second.
        object_spin_rad_per_s: most that it turns per second.
        flicker: least and largest depth of the light's flicker, 0 to 1.
        flicker_hz: slowest and fastest flicker.
        light_lux: dimmest and brightest white, lux at the focal plane.
    """

    camera_shift: float = 0.15
    camera_turn_rad: float = 0.1
    camera_pan_per_s: float = 0.3
    objects: tuple[int, int] = (0, 3)
    object_speed: float = 0.5
    object_spin_rad_per_s: float = 2.0
    flicker: tuple[float, float] = (0.0, 0.0)
    flicker_hz: tuple[float, float] = (2.0, 120.0)
    light_lux: tuple[float, float] = (2.0, 500.0)


HAND_HELD: Final = Manner()
PASSING: Final = Manner(
    camera_shift=0.004, camera_turn_rad=0.002, camera_pan_per_s=0.0, objects=(2, 7),
    object_speed=1.2, object_spin_rad_per_s=8.0,
)  # fmt: skip
FLICKER: Final = Manner(
    camera_shift=0.03, camera_pan_per_s=0.05, objects=(1, 4), flicker=(0.1, 0.7),
)  # fmt: skip
NEARLY_STILL: Final = Manner(
    camera_shift=0.004, camera_turn_rad=0.003, camera_pan_per_s=0.0, objects=(0, 2),
    object_speed=0.1, object_spin_rad_per_s=0.5, light_lux=(0.05, 50.0),
)  # fmt: skip


class ObjectScene:
    """Shapes before a textured wall, in linear light and analytic in time.

    As in `DrivingWorld`, the same time always gives the same picture, in lux at the focal plane.

    Args:
        height: rows of the image.
        width: columns of the image.
        seed: integers that name this scene.
        manner: how much moves and how bright it is.

    Example:
        >>> scene = ObjectScene(height=24, width=32, seed=(1, 2), manner=PASSING)
        >>> scene.radiance(500_000).shape
        (24, 32)
    """

    def __init__(self, *, height: int, width: int, seed: tuple[int, ...], manner: Manner) -> None:
        """Draw the scene; rendering draws nothing any more."""
        self.height, self.width = height, width
        rng = np.random.default_rng(np.random.SeedSequence(seed))
        self._texture = draw_texture(rng)
        self._zoom = float(rng.uniform(0.5, 2.5))  # texels of the wall per 1/120 of the height
        swing, turn = manner.camera_shift, manner.camera_turn_rad
        pan = manner.camera_pan_per_s
        self._camera = [
            draw_swing(rng, rng.uniform(0, 4), rng.uniform(-pan, pan), swing),
            draw_swing(rng, rng.uniform(0, 4), rng.uniform(-pan, pan), swing),
            draw_swing(rng, rng.uniform(0, 2 * np.pi), 0.0, turn),
        ]
        low, high = np.log(manner.light_lux)
        self.light_lux = float(np.exp(rng.uniform(low, high)))
        self._flicker = float(rng.uniform(*manner.flicker))
        self._flicker_hz = float(np.exp(rng.uniform(*np.log(manner.flicker_hz))))
        count = int(rng.integers(manner.objects[0], manner.objects[1] + 1))
        self._aspect = width / height
        self.objects = [draw_object(rng, manner, self._aspect) for _ in range(count)]

    def _light(self, t_s: float) -> float:
        wave = 0.5 + 0.5 * np.sin(2.0 * np.pi * self._flicker_hz * t_s)
        return float(self.light_lux * (1.0 - self._flicker * wave))

    def _placed(self, t_s: float) -> NDArray[np.float64]:
        rows = [each.row(t_s, self._aspect) for each in self.objects]
        return np.array(rows).reshape(len(rows), OBJECT_COLUMNS)

    def radiance(self, t_us: float) -> NDArray[np.float32]:
        """The picture at `t_us` microseconds since the start, lux at the focal plane, (H, W)."""
        t_s = 1e-6 * t_us
        image = np.empty((self.height, self.width), np.float32)
        right, down, turn = (swing.at(t_s) for swing in self._camera)
        camera = np.array([right, down, np.cos(turn), np.sin(turn), 120.0 * self._zoom])
        paint_objects(image, self._texture, camera, self._placed(t_s), self._light(t_s))
        return image

    def view(self, t_us: float) -> ActorsInView:
        """Outlines of the objects at `t_us`; what a nearer one hides is not taken off."""
        placed = self._placed(1e-6 * t_us) * np.array([self.height] * 3 + [1.0] * 5)
        boxes, seen = np.zeros((len(placed), 4)), np.zeros(len(placed))
        limits = np.array([self.width, self.height, self.width, self.height], np.float64)
        for k, (x, y, size, angle, shape, *_) in enumerate(placed):
            reach = size * np.array([radius_at(int(shape), theta) for theta in OUTLINE])
            across, along = x + reach * np.cos(OUTLINE + angle), y + reach * np.sin(OUTLINE + angle)
            boxes[k] = across.min(), along.min(), across.max(), along.max()
            inside = (across >= 0) & (across < self.width) & (along >= 0) & (along < self.height)
            clipped = np.clip(boxes[k], 0.0, limits)
            share = np.prod(clipped[2:] - clipped[:2]) / np.prod(boxes[k, 2:] - boxes[k, :2])
            seen[k] = share if inside.any() else 0.0
        shown = np.flatnonzero(seen > 0.0)
        return ActorsInView(
            boxes=boxes[shown],
            labels=placed[shown, 4].astype(np.int64) + FIRST_LABEL,
            tracks=shown,
            visible=seen[shown],
            owner=np.full((self.height, self.width), -1, np.int32),
        )


@dataclass(frozen=True, kw_only=True)
class MovingObject:
    """A shape with a texture of its own that moves over the image and turns.

    Args:
        shape: number in `SHAPES`.
        size: radius, a share of the image's height.
        x: place across, a share of the height; what leaves the image comes in on the other side.
        y: place down.
        angle: radian.
        albedo: mean share of the light that comes back.
        contrast: of its texture.
        patch: where in the texture it was cut out, texels.
    """

    shape: int
    size: float
    x: Swing
    y: Swing
    angle: Swing
    albedo: float
    contrast: float
    patch: float

    def row(self, t_s: float, aspect: float) -> tuple[float, ...]:
        """What the painter reads: place, size, angle, shape, albedo, contrast and patch."""
        margin = 1.5 * self.size
        x = (self.x.at(t_s) + margin) % (aspect + 2 * margin) - margin
        y = (self.y.at(t_s) + margin) % (1.0 + 2 * margin) - margin
        kind = float(self.shape)
        return x, y, self.size, self.angle.at(t_s), kind, self.albedo, self.contrast, self.patch


def draw_swing(rng: np.random.Generator, start: float, per_s: float, amplitude: float) -> Swing:
    """A motion with a slow sway, a faster one and a tremor."""
    rates = rng.uniform((0.2, 0.8, 5.0), (0.8, 3.0, 12.0))
    parts = amplitude * rng.uniform(0.3, 1.0) * np.array([1.0, 0.3, 0.03])
    return Swing(
        start=start,
        per_s=per_s,
        amplitudes=tuple(parts),
        rates_hz=tuple(rates),
        phases=tuple(rng.uniform(0.0, 2.0 * np.pi, 3)),
    )


def draw_object(rng: np.random.Generator, manner: Manner, aspect: float) -> MovingObject:
    """An object of random shape, texture and motion."""
    speed = manner.object_speed * rng.uniform(0.1, 1.0)
    heading = rng.uniform(0.0, 2.0 * np.pi)
    spin = manner.object_spin_rad_per_s
    sway = 0.1 * manner.object_speed
    return MovingObject(
        shape=int(rng.integers(len(SHAPES))),
        size=float(rng.uniform(0.06, 0.28)),
        x=draw_swing(rng, rng.uniform(0, aspect), speed * np.cos(heading), sway),
        y=draw_swing(rng, rng.uniform(0, 1), 0.5 * speed * np.sin(heading), sway),
        angle=Swing(start=float(rng.uniform(0, 6.28)), per_s=float(rng.uniform(-spin, spin))),
        albedo=float(np.exp(rng.uniform(np.log(0.04), np.log(0.9)))),
        contrast=float(rng.uniform(0.0, 1.0)),
        patch=float(rng.uniform(0, TEXTURE_SIDE)),
    )


def draw_texture(rng: np.random.Generator) -> NDArray[np.float32]:
    """A periodic wall, share of light that comes back in (0, 1), shape (512, 512).

    Noise whose amplitude falls with the frequency, as in pictures of nature, under rectangles and
    stripes with sharp edges, as people build them.
    """
    side = TEXTURE_SIDE
    rows, columns = np.fft.fftfreq(side)[:, None], np.fft.rfftfreq(side)[None]
    frequency = np.hypot(rows, columns)
    frequency[0, 0] = 1.0
    white = np.fft.rfft2(rng.standard_normal((side, side)))
    cloud = np.fft.irfft2(white / frequency ** rng.uniform(0.9, 1.6), (side, side))
    log_albedo = rng.uniform(0.2, 0.9) * (cloud - cloud.mean()) / cloud.std()
    for _ in range(int(rng.integers(0, 60))):
        top, left = rng.integers(0, side, 2)
        high, wide = rng.integers(4, 160, 2)
        place = np.ix_((top + np.arange(high)) % side, (left + np.arange(wide)) % side)
        log_albedo[place] = rng.normal(0.0, 0.8) + 0.3 * log_albedo[place]
    if rng.random() < 0.3:
        period = 2.0 ** rng.integers(3, 7)
        log_albedo += rng.uniform(0.2, 1.0) * np.sign(np.sin(2 * np.pi * np.arange(side) / period))
    albedo: NDArray[np.float32] = np.exp(np.clip(log_albedo - 1.2, -4.0, 0.0)).astype(np.float32)
    return albedo
