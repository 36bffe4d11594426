"""One recording of a trial: what the camera sees, and every stream that is compared with it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from eqs.events import Events
from eqs.metrics import corruptions as damage
from eqs.scenes import EventSensor, FrameCamera
from eqs.trial.chains import CEILING, Level, damage_chains, record, sensor_chains

WINDOW_US: Final = 50_000
OTHER_SPECIMEN: Final = 1000  # added to a camera's seed
SIMULATOR, BLANK, CHANCE = "simulator", "blank", "chance"


class Scene(Protocol):
    """Light at any instant."""

    def radiance(self, t_us: float) -> NDArray[np.float32]:
        """Lux, shape (height, width)."""


class Simulator(Protocol):
    """Makes events of frames."""

    def simulate(
        self,
        frames: NDArray[Any],
        timestamps_us: Any,  # noqa: ANN401
        sequence: str = "",
    ) -> Events:
        """The events of a clip."""


@dataclass(frozen=True, kw_only=True)
class RenderedTrial:
    """A scene, a camera and the simulators that are given its frames.

    Args:
        scene: what is recorded.
        other: another scene of its kind, which lends chance.
        sensor: the camera.
        windows: windows of 50 ms.
        key: names the noise.
        simulators: by name.
    """

    scene: Scene
    other: Scene
    sensor: EventSensor
    windows: int
    key: tuple[int, ...]
    simulators: Mapping[str, Simulator]

    @property
    def stop_us(self) -> int:
        """The end of the last window; the first begins at 0."""
        return self.windows * WINDOW_US

    def reference(self) -> Events:
        """What the camera records."""
        return record(self.sensor, self._light(self.scene), (*self.key, 0))

    def levels(self) -> Iterator[Level]:
        """Every stream that is compared with the reference; simulators by their number as step."""
        light, key = self._light(self.scene), (*self.key, 1)
        twin = replace(self.sensor, seed=self.sensor.seed + OTHER_SPECIMEN)
        ceiling = record(twin, light, key)
        yield Level(CEILING, 0, lambda: ceiling)
        yield Level(BLANK, 0, lambda: damage.blank(ceiling))
        yield Level(CHANCE, 0, lambda: record(twin, self._light(self.other), key))
        yield from sensor_chains(twin, light, key)
        yield from damage_chains(ceiling, start_us=0, stop_us=self.stop_us)
        yield from simulated(self.simulators, *self._frames())

    def _light(self, scene: Scene) -> NDArray[np.float32]:
        times = range(0, self.stop_us + 1, self.sensor.step_us)
        return np.stack([scene.radiance(t) for t in times])

    def _frames(self) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
        camera, times = FrameCamera(), np.arange(0, self.stop_us + 1, WINDOW_US, dtype=np.int64)
        exposure = camera.meter(self.scene.radiance(float(self.stop_us // 2)))
        shown = [
            camera.expose(self.scene.radiance, int(t), exposure, (*self.key, 2, k))
            for k, t in enumerate(times)
        ]
        return np.stack(shown), times


@dataclass(frozen=True, kw_only=True)
class RealTrial:
    """A real recording, damaged in the ways that need no second look at the scene.

    Convention: its ceiling is the recording with a tenth of its events dropped; chance another
    recording.

    Args:
        events: the recording.
        other: another one of the same size.
        frames: its frames.
        frame_times_us: their times.
        start_us: start of the first window.
        stop_us: end of the last.
        simulators: by name.
    """

    events: Events
    other: Events
    frames: NDArray[Any]
    frame_times_us: NDArray[np.int64]
    start_us: int
    stop_us: int
    simulators: Mapping[str, Simulator]

    def reference(self) -> Events:
        """The recording."""
        return self.events

    def levels(self) -> Iterator[Level]:
        """Every stream that is compared with it."""
        ceiling = damage.thinned(self.events, 0.1, key="trial")
        yield Level(CEILING, 0, lambda: ceiling)
        yield Level(BLANK, 0, lambda: damage.blank(ceiling))
        yield Level(CHANCE, 0, lambda: damage.on_clock_of(self.other, self.start_us, self.stop_us))
        yield from damage_chains(ceiling, start_us=self.start_us, stop_us=self.stop_us)
        yield from simulated(self.simulators, self.frames, self.frame_times_us)


def simulated(
    simulators: Mapping[str, Simulator], frames: NDArray[Any], times_us: NDArray[np.int64]
) -> Iterator[Level]:
    """What every simulator makes of the frames."""
    for number, each in enumerate(simulators.values()):
        yield Level(SIMULATOR, number, partial(each.simulate, frames, times_us, "trial"))
