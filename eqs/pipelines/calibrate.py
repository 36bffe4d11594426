"""Look for the parameters at which a simulator's events look most like real ones to the judge."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
from hydra.utils import instantiate
from numpy.typing import NDArray
from omegaconf import DictConfig
from rich.console import Console
from rich.progress import Progress
from scipy import optimize

from eqs.data import Recording
from eqs.events import EventReader, Events
from eqs.metrics.baselines import baselines
from eqs.metrics.grid import fewest_windows
from eqs.pipelines.build import dataset
from eqs.pipelines.command import explained
from eqs.pipelines.judge import require_judge
from eqs.pipelines.score import recording_grid
from eqs.pipelines.scoring import Scoring, find_scoring
from eqs.pipelines.sensors import results_folder
from eqs.simulators import Simulator
from eqs.study import calibration_table, print_calibration, write_table
from eqs.study.notes import few_windows

log = logging.getLogger(__name__)
FIRST_STEP = 0.7  # of the search, in natural-log units: a factor of two


@dataclass(frozen=True, kw_only=True)
class Range:
    """Parameters that share one value, and the bounds of that value."""

    parameters: tuple[str, ...]
    low: float
    high: float


@dataclass
class Search:
    """Scores a simulator on a few recordings and remembers every try.

    Args:
        scoring: what scores.
        simulator: where the search starts.
        ranges: what may change.
        clips: the recordings to tune on.
        tried: values and scores so far.
    """

    scoring: Scoring
    simulator: Simulator
    ranges: Sequence[Range]
    clips: Sequence[Clip]
    tried: list[dict[str, float]] = field(default_factory=list)

    def at(self, logs: NDArray[np.float64]) -> Simulator:
        """The simulator with these natural logarithms of its free values, kept in bounds."""
        changes: dict[str, Any] = {}
        for each, value in zip(self.ranges, np.exp(logs).tolist(), strict=True):
            inside = min(max(value, each.low), each.high)
            changes |= dict.fromkeys(each.parameters, inside)
        return replace(self.simulator, **changes)

    def start(self) -> NDArray[np.float64]:
        """Natural logarithms of the values that the simulator has."""
        return np.log([getattr(self.simulator, each.parameters[0]) for each in self.ranges])

    def miss(self, logs: NDArray[np.float64]) -> float:
        """One minus the mean score, which the search makes small."""
        candidate = self.at(logs)
        score = float(np.mean([clip.score(self.scoring, candidate) for clip in self.clips]))
        values = {e.parameters[0]: getattr(candidate, e.parameters[0]) for e in self.ranges}
        self.tried.append({**values, "eqs": score})
        return 1.0 - score


@dataclass(frozen=True)
class Clip:
    """Frames of a recording and the real events of the windows that are scored."""

    name: str
    frames: NDArray[Any]
    times_us: NDArray[np.int64]
    real: Events
    start_us: int
    stop_us: int

    @classmethod
    def of(cls, recording: Recording, rows: int | None, window_us: int) -> Clip:
        """Read a recording into memory."""
        clip = recording.frames()
        frames = clip.read(0, len(clip))
        size = recording.height, recording.width
        with EventReader(recording.events_path, *size, rows=rows) as reader:
            grid = recording_grid(recording, reader, window_us)
            start, stop = grid.start_us, grid.stop_us
            real = reader.window(start, stop)
        frames = frames[:, : real.height]
        return cls(recording.name, frames, recording.frame_times_us, real, start, stop)

    def windows(self, scoring: Scoring) -> int:
        """The number of windows that count."""
        definition = scoring.headline.definition
        cut = (self.stop_us - self.start_us) // definition.window_us
        return cut - definition.warmup_of(cut)

    def simulated(self, simulator: Simulator) -> Events:
        """What a simulator makes of the frames."""
        return simulator.simulate(self.frames, self.times_us, self.name)

    def score(self, scoring: Scoring, simulator: Simulator) -> float:
        """Headline score of a simulator."""
        return self.score_events(scoring, self.simulated(simulator))

    def score_events(self, scoring: Scoring, events: Events) -> float:
        """Headline score of what a simulator made."""
        (found,) = scoring.metric.score(
            self.real, [events], start_us=self.start_us, stop_us=self.stop_us
        )
        return found[scoring.headline.name].score

    def measures(self, scoring: Scoring, simulator: Simulator) -> dict[str, float]:
        """The score, the rate and every baseline."""
        events = self.simulated(simulator)
        values = baselines(
            events,
            self.real,
            scoring.headline.definition,
            start_us=self.start_us,
            stop_us=self.stop_us,
            frame_times_us=self.times_us,
        )
        inside = events.window(self.start_us, self.stop_us)
        ratio = len(inside) / max(len(self.real), 1)
        return {"eqs": self.score_events(scoring, events), "events_per_real_event": ratio, **values}


@explained
def calibrate(cfg: DictConfig) -> dict[str, Any]:
    """Search, report before and after on recordings that the search did not see.

    Returns:
        The best values by parameter.

    Raises:
        ValueError: there is nothing to calibrate, or no judge.
    """
    simulator, ranges = instantiate(cfg.sim), free_ranges(cfg.search)
    check(simulator, ranges)
    require_judge(cfg)  # before a data set is generated
    data = dataset(cfg)
    scoring = find_scoring(cfg, data)
    train, test = (data.recordings(split) for split in ("train", "test"))
    shape = data.crop_rows, scoring.headline.definition.window_us
    data.make_events([*train[: cfg.tune_on], *test])
    clips = [Clip.of(recording, *shape) for recording in train[: cfg.tune_on]]
    counted = {clip.name: clip.windows(scoring) for clip in clips}
    search = Search(scoring, simulator, ranges, clips)
    best = run(search, cfg.evaluations)
    measured: dict[str, list[dict[str, float]]] = {"before": [], "after": []}
    for recording in test:
        clip = Clip.of(recording, *shape)
        counted[clip.name] = clip.windows(scoring)
        measured["before"].append(clip.measures(scoring, simulator))
        measured["after"].append(clip.measures(scoring, best))
    console, results = Console(), results_folder(cfg)
    write_table(pd.DataFrame(search.tried), results / f"calibration-{simulator.name}.csv")
    values = {each.parameters[0]: getattr(best, each.parameters[0]) for each in ranges}
    before = {name: getattr(simulator, name) for name in values}
    print_calibration(calibration_table(measured), before, values, console)
    fewest = fewest_windows(scoring.headline.definition.warmup_windows)
    if few := few_windows(counted, fewest):
        log.warning("%s", few)
    return values


def free_ranges(search: Mapping[str, Any]) -> list[Range]:
    """The configured ranges."""
    return [
        Range(parameters=tuple(each.parameters), low=each.low, high=each.high)
        for each in search.values()
    ]


def check(simulator: object, ranges: Sequence[Range]) -> None:
    """Refuse what cannot be searched.

    Raises:
        ValueError: no simulator, an unknown parameter, or bounds that leave out where it starts.
    """
    if not isinstance(simulator, Simulator):
        name = getattr(simulator, "name", type(simulator).__name__)
        raise ValueError(
            f"Expected a simulator to calibrate, got sim={name}; set sim=v2e or another"
        )
    for each in ranges:
        for name in each.parameters:
            value = simulator.parameters().get(name)
            if not isinstance(value, int | float) or not 0 < each.low <= value <= each.high:
                raise ValueError(
                    f"Expected {simulator.name} to have a {name} between {each.low} and "
                    f"{each.high}, got {value!r}; set search, or sim.{name} for another start"
                )


def run(search: Search, evaluations: int) -> Simulator:
    """Nelder and Mead's simplex search over logarithms, from the configured values."""
    start = search.start()
    simplex = np.vstack([start, start + FIRST_STEP * np.eye(len(start))])
    outside = simplex > np.log([each.high for each in search.ranges])
    simplex[outside] -= 2 * FIRST_STEP  # towards the other side
    with Progress() as progress:
        task = progress.add_task(f"calibrating {search.simulator.name}", total=evaluations)

        def miss(logs: NDArray[np.float64]) -> float:
            value = search.miss(logs)
            progress.advance(task)
            return value

        found = optimize.minimize(
            miss,
            start,
            method="Nelder-Mead",
            options={
                "maxfev": evaluations,
                "initial_simplex": simplex,
                "xatol": 0.02,
                "fatol": 1e-4,
            },
        )
    return search.at(found.x)
