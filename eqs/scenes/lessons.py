"""Short recordings of many scenes by many event cameras, for a judge to learn from."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.progress import track

from eqs.events import Events
from eqs.files import complete_file, one_at_a_time
from eqs.processors import available_cores, side_by_side
from eqs.representations import stacked_histogram
from eqs.scenes.labels import LabelRule
from eqs.scenes.objects import ObjectScene
from eqs.scenes.sensor import ReferenceSensor
from eqs.scenes.world import DrivingWorld

VERSION: Final = 1  # raise it whenever the same settings give other lessons
WINDOW_US: Final = 50_000
LEAD_IN_US: Final = 20_000
PICTURES: Final = 50  # rendered at once
# How widely the cameras of lessons vary: standard deviation of the natural log of a parameter.
SPREAD: Final = {
    "threshold_on_log": 0.25,
    "threshold_off_log": 0.25,
    "threshold_mismatch_log": 0.4,
    "photocurrent_fa_per_lux": 0.5,
    "amplifier_time_us": 0.4,
    "shot_noise_factor": 0.3,
    "leak_hz": 0.8,
    "hot_pixel_fraction": 0.8,
    "refractory_us": 0.7,
    "jitter_us": 0.5,
    "row_service_us": 0.7,
}


class Lesson(NamedTuple):
    """A recording as a training reads it.

    Args:
        histograms: counts of events, uint8, shape (windows, 20, height, width).
        boxes: rows (window, class, left, top, right, bottom) of what is in sight at the end of a
            window, pixels, float32.
    """

    histograms: NDArray[np.uint8]
    boxes: NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class Lessons:
    """Recordings by number, each drawn from the seed and its number alone.

    Every other one or so shows a street of `dsec_mini`'s kind, by day or by night; the others show
    objects. Each has an event camera of its own, one of `sensors` with its parameters moved.

    Args:
        count: how many there are to learn from.
        held_out: how many more there are to test on; their numbers follow.
        windows: windows of 50 ms of each.
        seed: draws all of them.
        sizes: by size as in 128x96 its share.
        street_share: share of streets.
        night_share: share of nights among the streets.
        manners: by name how much moves in the other scenes, all equally often.
        sensors: the cameras, all equally often.

    Raises:
        ValueError: there is nothing to draw from.
    """

    count: int
    held_out: int
    windows: int
    seed: int
    sizes: Mapping[str, float]
    street_share: float
    night_share: float
    manners: Mapping[str, Any]
    sensors: Mapping[str, ReferenceSensor]

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn."""
        if not (self.sizes and self.manners and self.sensors):
            raise ValueError(
                "Expected sizes, manners and sensors to draw from, got none of one; set "
                "lessons.sizes, lessons.manners and lessons.sensors"
            )

    def definition_hash(self) -> str:
        """Twelve hexadecimal digits that change with anything the lessons depend on."""
        parts = asdict(self) | {"version": VERSION, "spread": SPREAD}
        del parts["count"], parts["held_out"]
        text = json.dumps(parts, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    def prepare(self, root: Path) -> Path:
        """Render those that are missing below `root`, side by side; the folder they lie in."""
        folder = root / f"lessons_{self.definition_hash()}"
        with one_at_a_time(folder, f"rendering {folder.name}"):
            folder.mkdir(parents=True, exist_ok=True)
            numbers = range(self.count + self.held_out)
            jobs = [(self, n, folder) for n in numbers if not _path(folder, n).is_file()]
            workers = min(available_cores(), max(1, len(jobs)))
            done = map(_write, jobs) if workers <= 1 else side_by_side(_write, jobs, workers)
            for _ in track(done, description="lessons", total=len(jobs)):
                pass
        return folder

    def load(self, folder: Path, number: int) -> Lesson:
        """One of those that `prepare` left in a folder."""
        with np.load(_path(folder, number)) as data:
            return Lesson(data["histograms"], data["boxes"])

    def make(self, number: int) -> Lesson:
        """Draw, render and record one."""
        rng = np.random.default_rng(np.random.SeedSequence([self.seed, number]))
        names, shares = [*self.sizes], np.array([*self.sizes.values()], np.float64)
        size = str(rng.choice(names, p=shares / shares.sum()))
        width, height = (int(each) for each in size.split("x"))
        sensor = moved(rng, [*self.sensors.values()][int(rng.integers(len(self.sensors)))])
        world = self._world(rng, number, height, width)
        stream = sensor.start(height, width, noise_key=(self.seed, number))
        times = range(0, LEAD_IN_US + self.windows * WINDOW_US + 1, sensor.step_us)
        parts = [
            stream.step(np.stack([world.radiance(t) for t in times[k : k + PICTURES]]))
            for k in range(0, len(times), PICTURES)
        ]
        events = Events.concatenate([*parts, stream.finish()])
        ends = LEAD_IN_US + WINDOW_US * np.arange(1, self.windows + 1)
        histograms = [
            stacked_histogram(
                events.window(end - WINDOW_US, end), start_us=end - WINDOW_US, stop_us=end
            )
            for end in ends.tolist()
        ]
        return Lesson(np.stack(histograms), _boxes(world, ends.tolist()))

    def _world(
        self, rng: np.random.Generator, number: int, height: int, width: int
    ) -> DrivingWorld | ObjectScene:
        seed = (self.seed, number, 1)
        if rng.random() < self.street_share:
            return DrivingWorld(
                height=height,
                width=width,
                seed=seed,
                night=bool(rng.random() < self.night_share),
                duration_s=1e-6 * (LEAD_IN_US + self.windows * WINDOW_US),
            )
        manners = [*self.manners.values()]
        manner = manners[int(rng.integers(len(manners)))]
        return ObjectScene(height=height, width=width, seed=seed, manner=manner)


def moved(rng: np.random.Generator, sensor: ReferenceSensor) -> ReferenceSensor:
    """A camera like another one, with its parameters moved and a fixed pattern of its own."""
    factors = {name: np.exp(spread * rng.standard_normal()) for name, spread in SPREAD.items()}
    values: dict[str, Any] = {n: float(getattr(sensor, n) * each) for n, each in factors.items()}
    return replace(sensor, **values, seed=int(rng.integers(1 << 31)))


def _boxes(world: DrivingWorld | ObjectScene, times_us: Sequence[int]) -> NDArray[np.float32]:
    """Rows of `Lesson.boxes`."""
    rule, found = LabelRule(), []
    for index, time_us in enumerate(times_us):
        rows = rule.boxes(world.view(time_us), time_us)
        left, top = rows["x"], rows["y"]
        sides = (left, top, left + rows["w"], top + rows["h"])
        number = np.full(len(rows), index)
        found.append(np.stack([number, rows["class_id"], *sides], axis=1).astype(np.float32))
    return np.concatenate(found)


def _path(folder: Path, number: int) -> Path:
    return folder / f"{number:05d}.npz"


def _write(job: tuple[Lessons, int, Path]) -> None:
    lessons, number, folder = job
    made = lessons.make(number)
    with complete_file(_path(folder, number)) as partial, partial.open("wb") as file:
        np.savez_compressed(file, histograms=made.histograms, boxes=made.boxes)
