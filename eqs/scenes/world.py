"""The procedural driving world: radiance and labels at any instant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eqs.scenes.optics import (
    CAM_COS,
    CAM_PITCH,
    CAM_ROLL,
    CAM_SIN,
    CAM_X,
    CAM_Y,
    CAM_Z,
    CAMERA_COLUMNS,
    FOCAL,
    MID_COLUMN,
    MID_ROW,
)
from eqs.scenes.outline import outline_actors
from eqs.scenes.paint_actors import measure_actors, paint_actors
from eqs.scenes.paint_street import COLUMN_FACTS, paint_street
from eqs.scenes.plan import Street, draw_plan, painted_surfaces
from eqs.scenes.polygons import Polygons

FIELD_OF_VIEW_RAD = np.deg2rad(44.0)


@dataclass(frozen=True, kw_only=True)
class ActorsInView:
    """What can be seen of the labelled actors at one instant; one row per actor in sight.

    Args:
        boxes: left, top, right, bottom of the whole outline in pixels, unclipped, shape (n, 4).
        labels: DSEC-Detection class ids, shape (n,).
        tracks: actor numbers, constant over time, shape (n,).
        visible: visible share of the outline inside the image, shape (n,).
        owner: nearest actor per pixel, -1 for none, int32 (H, W).
    """

    boxes: NDArray[np.float64]
    labels: NDArray[np.int64]
    tracks: NDArray[np.int64]
    visible: NDArray[np.float64]
    owner: NDArray[np.int32]


class DrivingWorld:
    """A street that the camera drives along, in linear light and analytic in time.

    Everything that moves is a closed function of time, so any instant can be rendered in any
    order: the same time always gives the same picture. Radiance is given as the illuminance it
    causes at the focal plane, in lux.

    Args:
        height: rows of the image.
        width: columns of the image; the horizontal field of view is 44 degrees.
        seed: integers that name this world.
        night: street lamps, lit windows and headlights instead of daylight.
        still: the camera waits instead of driving.
        duration_s: for how long there shall be something to see.

    Example:
        >>> world = DrivingWorld(height=24, width=32, seed=(1, 2), duration_s=1.0)
        >>> world.radiance(500_000).shape
        (24, 32)
    """

    def __init__(
        self,
        *,
        height: int,
        width: int,
        seed: tuple[int, ...],
        night: bool = False,
        still: bool = False,
        duration_s: float = 3.0,
    ) -> None:
        """Draw the street; rendering draws nothing any more."""
        self.height, self.width, self.night, self.still = height, width, night, still
        street = Street(seed=seed, night=night, still=still, duration_s=duration_s)
        plan = draw_plan(street, width)
        self._light, self._drive, self.actors = plan.light, plan.drive, plan.actors
        self._surfaces = painted_surfaces(plan)
        self._rows = np.array([actor.row() for actor in self.actors])
        self._parts = np.concatenate([actor.parts for actor in self.actors])
        self._first = np.cumsum([0] + [len(actor.parts) for actor in self.actors])
        self._polygons = Polygons.room_for(len(self.actors))
        self._layers = np.zeros((3, height, width))
        self._columns = np.zeros((width, COLUMN_FACTS))

    def camera(self, t_us: float) -> NDArray[np.float64]:
        """The camera vector at a time in microseconds since the start."""
        x, y, z, yaw, pitch, roll = self._drive.pose(t_us * 1e-6)
        camera = np.zeros(CAMERA_COLUMNS)
        camera[CAM_X], camera[CAM_Y], camera[CAM_Z] = x, y, z
        camera[CAM_COS], camera[CAM_SIN] = np.cos(yaw), np.sin(yaw)
        camera[CAM_PITCH], camera[CAM_ROLL] = pitch, roll
        camera[FOCAL] = 0.5 * self.width / np.tan(0.5 * FIELD_OF_VIEW_RAD)
        camera[MID_COLUMN], camera[MID_ROW] = 0.5 * self.width, 0.5 * self.height
        return camera

    def _outline(self, t_us: float) -> NDArray[np.float64]:
        camera = self.camera(t_us)
        outline_actors(
            self._polygons,
            self._rows,
            self._parts,
            self._first,
            t_us * 1e-6,
            camera,
            self._light,
        )
        return camera

    def radiance(self, t_us: float) -> NDArray[np.float32]:
        """The picture at `t_us` microseconds since the start, lux at the focal plane, (H, W)."""
        camera = self._outline(t_us)
        image = np.empty((self.height, self.width), np.float32)
        paint_street(image, self._surfaces, camera, self._light, self._columns)
        paint_actors(image, self._polygons, self._layers)
        return image

    def view(self, t_us: float) -> ActorsInView:
        """Outlines and visibility of the labelled actors at `t_us`."""
        self._outline(t_us)
        owner = np.empty((self.height, self.width), np.int32)
        areas = measure_actors(self._polygons, owner, self._layers)
        labels = self._rows[:, -1].astype(np.int64)
        shown = np.flatnonzero((labels >= 0) & (areas[:, 1] > 0.0))
        return ActorsInView(
            boxes=self._polygons.boxes[shown].copy(),
            labels=labels[shown],
            tracks=shown,
            visible=areas[shown, 0] / areas[shown, 1],
            owner=owner,
        )
