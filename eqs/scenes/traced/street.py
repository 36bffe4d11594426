"""The driving world's street, ray traced: photocurrents at any instant."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from eqs.scenes.actors import Actor
from eqs.scenes.plan import Street, draw_plan
from eqs.scenes.traced.camera import Lens, camera_plugin, developed, pose
from eqs.scenes.traced.engine import engine
from eqs.scenes.traced.materials import Plugin, shines, surface
from eqs.scenes.traced.shapes import Look, moves, placed, solids
from eqs.scenes.traced.sources import sources
from eqs.scenes.traced.surroundings import buildings, ground_meshes, mesh, mirrored
from eqs.scenes.world import DrivingWorld

VERSION: Final = 1  # raise it whenever the same parameters give other frames
BOUNCES: Final = 4  # surfaces on the way from the lens to a light, and the light


class TracedStreet:
    """The street of a `DrivingWorld` in three dimensions and in colour, seen through a lens.

    Actors, markings, houses, sky, sun and the camera's way are those of the world that the same
    arguments name; how light goes between them is traced, wavelength by wavelength.

    Convention: light is in lux at the focal plane times the mean quantum efficiency, as
    `eqs.frames.photocurrent` has it.

    Args:
        height: rows of the image.
        width: columns of the image; the horizontal field of view is 44 degrees.
        seed: integers that name the world.
        night: street lamps and headlights instead of daylight.
        still: the camera waits instead of driving.
        duration_s: for how long there shall be something to see.
        lens: the thin lens.
        samples_per_pixel: paths traced for each pixel; the noise falls with their square root.
        noise_seed: draws the paths, for all instants the same ones: noise that rests where the
            picture does is no event.

    Raises:
        ValueError: Mitsuba is not installed, or a count is below one.
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
        lens: Lens | None = None,
        samples_per_pixel: int = 64,
        noise_seed: int = 0,
    ) -> None:
        """Draw the street and hand it to the tracer."""
        if min(height, width, samples_per_pixel) < 1:
            raise ValueError(
                "Expected at least one row, column and sample, got "
                f"{height}, {width} and {samples_per_pixel}; set scene.samples_per_pixel"
            )
        street = Street(seed=seed, night=night, still=still, duration_s=duration_s)
        self.world = DrivingWorld(height=height, width=width, **asdict(street))
        plan = draw_plan(street, width)
        self.actors, self.noise_seed = plan.actors, noise_seed
        self.lens = lens or Lens()
        parts: Plugin = {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": BOUNCES},
            "camera": camera_plugin(height, width, self.lens, samples_per_pixel),
            **sources(plan),
        }
        for number, each in enumerate([*ground_meshes(plan), *buildings(plan)]):
            parts[f"around_{number}"] = each
        for number, actor in enumerate(self.actors):
            parts |= _actor_meshes(number, actor)
        mi = engine()
        self.version = f"{VERSION}, mitsuba {mi.__version__}"
        self._scene = mi.load_dict(parts)
        self._data = mi.traverse(self._scene)
        self._moving = [number for number, actor in enumerate(self.actors) if moves(actor)]

    def photocurrent(self, t_us: float) -> NDArray[np.float32]:
        """The picture at `t_us` microseconds since the start, (H, W)."""
        self._go_to(t_us)
        film = engine().render(self._scene, seed=self.noise_seed)
        return developed(np.array(film, np.float32))

    def owner(self, t_us: float) -> NDArray[np.int32]:
        """Number of the actor in the middle of each pixel, -1 for none, (H, W)."""
        self._go_to(t_us)
        camera = self._scene.sensors()[0]
        height, width = self.world.height, self.world.width
        found = np.full((height, width), -1, np.int32)
        for row, column in np.ndindex(height, width):
            at = [(column + 0.5) / width, (row + 0.5) / height]
            ray, _ = camera.sample_ray(0.0, 0.5, at, [0.5, 0.5])
            hit = self._scene.ray_intersect(ray)
            name = hit.shape.id() if hit.is_valid() else ""
            if name.startswith("actor_"):
                found[row, column] = int(name.split("_")[1])
        return found

    def _go_to(self, t_us: float) -> None:
        """Put the camera and whatever moves where they are at a time."""
        mi, time_s = engine(), t_us * 1e-6
        place = mi.ScalarTransform4f(pose(self.world.camera(t_us)))
        self._data["camera.to_world"] = place
        if "beam.to_world" in self._data:
            self._data["beam.to_world"] = place
        for number in self._moving:
            actor = self.actors[number]
            for look, solid in solids(actor, time_s).items():
                corners = mirrored(placed(actor, solid.points, time_s))
                name = f"{_mesh_name(number, look)}.vertex_positions"
                self._data[name] = corners.astype(np.float32).ravel()
        self._data.update()


def _actor_meshes(number: int, actor: Actor) -> dict[str, Any]:
    """An actor at time zero, a mesh for each look."""
    found = {}
    for look, solid in solids(actor, 0.0).items():
        name = _mesh_name(number, look)
        parts = {"bsdf": surface(look.substance, look.albedo, number), **shines(look)}
        found[name] = mesh(name, placed(actor, solid.points, 0.0), solid.triangles, parts)
    return found


def _mesh_name(number: int, look: Look) -> str:
    bright = round(1e4 * look.albedo)
    return f"actor_{number}_{look.substance.name.lower()}_{bright}_{round(1e2 * look.emit)}"
