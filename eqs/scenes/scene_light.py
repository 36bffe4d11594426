"""Simulators fed by the renderer instead of by a camera's frames, as ESIM was meant.

Rebecq, Gehrig and Scaramuzza, "ESIM: an Open Event Camera Simulator", CoRL 2018, section 3:
adaptive sampling by the largest change of brightness.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from eqs.files import read_json
from eqs.frames import GreyImage
from eqs.scenes.sequence import RECORD, VERSION, SequencePlan

HEADROOM = 2.0
"""Light up to this many times the camera's white is seen; what is brighter counts as that."""
PROBE_US = 200
DARKEST = 0.01  # share of white below which changes do not count
CHUNK = 64
WHITE_LEVEL = 255.0


@dataclass(frozen=True, kw_only=True)
class SceneLight:
    """Linear light of a rendered recording, as often as it changes, without camera or eight bits.

    Level 255 is the white of the recording's frame camera, so models see the same scale as from
    its frames, but what saturates there does not here. It sees what the reference sensor sees and
    no simulator can: rows with it are marked.

    Args:
        step_log: change of the log light between two renderings, half a usual threshold.
        quantile: share of the pixels that may change by more; the fastest flicker.
        shortest_us: shortest time between two renderings.
        longest_us: longest one.

    Raises:
        ValueError: a value is out of range.
    """

    caveat: ClassVar[str] = "sees the light itself, as the sensor does"
    curve: ClassVar[str] = "rendered"

    step_log: float = 0.1
    quantile: float = 0.999
    shortest_us: int = 50
    longest_us: int = 10_000

    def __post_init__(self) -> None:
        """Check the values."""
        for name, fits in (
            ("step_log", self.step_log > 0),
            ("quantile", 0 < self.quantile <= 1),
            ("shortest_us", 0 < self.shortest_us <= self.longest_us),
        ):
            if not fits:
                raise ValueError(
                    f"Expected {name} in its range, got {getattr(self, name)!r}; set light.{name}"
                )

    def parameters(self) -> dict[str, Any]:
        """What changes the events."""
        return {"curve": self.curve, **asdict(self)}

    def image(self, frame: NDArray[Any], rounded_luma: bool = True) -> GreyImage:
        """Levels of what `clip` gives, whose white is `HEADROOM` times the camera's.

        Raises:
            ValueError: it is a frame of a camera.
        """
        if frame.dtype == np.uint8:
            raise ValueError(
                "Expected a rendered recording for light=rendered, got frames; set data=dsec_mini, "
                "or light=none"
            )
        return GreyImage.from_frame(HEADROOM * frame.astype(np.float64))

    def clip(
        self, folder: Path, frame_times_us: NDArray[np.int64]
    ) -> Iterator[tuple[NDArray[np.float32], NDArray[np.int64]]]:
        """Renderings from the first frame of a recording to its last, with their times, in chunks.

        Args:
            folder: of the recording.
            frame_times_us: times of its frames on its own clock.

        Raises:
            ValueError: the recording was not rendered here, or by another version.
        """
        plan = plan_of(folder)
        world = plan.world()
        white_lux = plan.exposure(world).white_lux
        first, last = int(frame_times_us[0]), int(frame_times_us[-1])

        def seen(time_us: int) -> NDArray[np.float32]:
            share = world.radiance(float(time_us - plan.t_offset_us)) / white_lux
            clipped: NDArray[np.float32] = np.minimum(share, HEADROOM)
            return clipped

        pictures: list[NDArray[np.float32]] = []
        times: list[int] = []
        for time_us, picture in self.instants(seen, first, last):
            pictures.append((WHITE_LEVEL / HEADROOM * picture).astype(np.float32))
            times.append(time_us)
            if len(pictures) == CHUNK:
                yield np.stack(pictures), np.array(times, np.int64)
                pictures, times = [], []
        if pictures:
            yield np.stack(pictures), np.array(times, np.int64)

    def instants(
        self, seen: Callable[[int], NDArray[np.float32]], first: int, last: int
    ) -> Iterator[tuple[int, NDArray[np.float32]]]:
        """Times at which light has changed by about a step, and what is then seen."""
        time_us = first
        while True:
            picture = seen(time_us)
            yield time_us, picture
            if time_us >= last:
                return
            later = seen(time_us + PROBE_US)
            change = np.abs(np.log((later + DARKEST) / (picture + DARKEST)))
            fastest = float(np.quantile(change, self.quantile)) / PROBE_US
            wait_us = self.step_log / fastest if fastest > 0 else math.inf
            time_us += int(min(max(wait_us, self.shortest_us), self.longest_us))
            time_us = min(time_us, last)


def plan_of(folder: Path) -> SequencePlan:
    """How a recording was rendered.

    Raises:
        ValueError: it was not rendered here, or by another version.
    """
    path = folder / RECORD
    description = read_json(path).get("description", {}) if path.is_file() else {}
    if description.get("version") != VERSION:
        found = f"version {description['version']}" if description else "no record of a rendering"
        raise ValueError(
            f"Expected a recording rendered by version {VERSION} in {folder} for light=rendered, "
            f"got {found}; set data=dsec_mini, or light=none"
        )
    return SequencePlan.of(description)
