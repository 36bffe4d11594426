"""Put every challenger of the score on trial, recording by recording, and count."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from hydra.utils import instantiate
from numpy.typing import NDArray
from omegaconf import DictConfig, OmegaConf
from rich.console import Console
from rich.progress import track

from eqs.data import Recording
from eqs.data.places import find_recordings
from eqs.data.recording import frames_in
from eqs.events import EventReader, Events
from eqs.files import complete_file, short_hash
from eqs.metrics import Definition, Judge, histogram_chunks
from eqs.metrics.features import pooled_features
from eqs.metrics.scoring import paired
from eqs.metrics.silence import Silence
from eqs.pipelines.command import explained
from eqs.processors import side_by_side
from eqs.trial import Challengers, Level, Means
from eqs.trial.challengers import HEADLINE, RESET, of_counts
from eqs.trial.means import Moments, load_means, save_means
from eqs.trial.recorded import RealTrial, RenderedTrial
from eqs.trial.tables import DEVELOPMENT, Found, write_tables

log = logging.getLogger(__name__)
VERSION: Final = 1
AT_ONCE: Final = 12  # streams beside the reference in one pass
DEFINITION: Final = Definition()
WINDOW_US: Final = DEFINITION.window_us


@explained
def trial(cfg: DictConfig) -> None:
    """Score all streams of all recordings by all judges; write tables to `cfg.out`.

    Raises:
        ValueError: a judge, scene or sensor is not there.
    """
    torch.set_num_threads(1)
    out = Path(cfg.out)
    plain: Any = OmegaConf.to_container(cfg, resolve=True)
    means = {judge: means_of(cfg, judge, out) for judge in map(str, cfg.judges)}
    all_means = means | {judge: means_of(cfg, judge, out) for judge in map(str, cfg.controls)}
    jobs = [
        Job(plain, half, sensor, scene, means if half == DEVELOPMENT else all_means)
        for half, chosen in cfg.halves.items()
        for scene in cfg.scenes
        for sensor in chosen.sensors
    ]
    if cfg.real is not None:
        jobs += [
            Job(plain, "real", str(cfg.real), n, all_means) for n in real_names(Path(cfg.real))
        ]
    found: list[Found] = []
    workers = min(cfg.workers, len(jobs))
    done = map(run_job, jobs) if workers <= 1 else side_by_side(run_job, jobs, workers)
    for each in track(done, description="trial", total=len(jobs)):
        found += each
    write_tables(found, [*cfg.simulators], out, Console())


@dataclass(frozen=True)
class Job:
    """One recording of a half, by all judges."""

    cfg: dict[str, Any]
    half: str
    sensor: str
    scene: str
    means: dict[str, Path]


def run_job(job: Job) -> list[Found]:
    """Make the streams of a recording once, and score them by every judge not yet done."""
    torch.set_num_threads(1)
    cfg = OmegaConf.create(job.cfg)
    judges = {name: Judge.load(name) for name in job.means}
    trial = real_trial(cfg, job) if job.half == "real" else rendered_trial(cfg, job)
    paths = {name: _path(cfg, job, name, judge) for name, judge in judges.items()}
    missing = {name: judge for name, judge in judges.items() if not paths[name].is_file()}
    if missing:
        for name, arrays in score(trial, missing, job.means).items():
            paths[name].parent.mkdir(parents=True, exist_ok=True)
            with complete_file(paths[name]) as partial, partial.open("wb") as file:
                np.savez(file, **arrays)  # type: ignore[arg-type]
    return [
        Found.load(path, half=job.half, sensor=job.sensor, scene=job.scene, judge=name)
        for name, path in paths.items()
    ]


def _path(cfg: DictConfig, job: Job, name: str, judge: Judge) -> Path:
    sensors = OmegaConf.to_container(cfg.sensors)
    key = short_hash(
        [VERSION, judge.weights_sha256, job.half, job.scene, cfg.seed, cfg.size, cfg.windows,
         dict(sensors).get(job.sensor, job.sensor), job.cfg["halves"].get(job.half),  # type: ignore[arg-type]
         job.cfg["worlds"].get(job.scene), seed_number(job), job.cfg["simulators"]]
    )  # fmt: skip
    label = Path(name).name
    sensor = Path(job.sensor).name
    return Path(cfg.out) / "recordings" / f"{job.half}-{sensor}-{job.scene}-{label}-{key}.npz"


def seed_number(job: Job) -> int:
    """The number of a scene among the kinds of scenes, from which its seeds are made; 0 if real."""
    names = sorted(job.cfg["worlds"])
    return names.index(job.scene) if job.scene in names else 0


def rendered_trial(cfg: DictConfig, job: Job) -> RenderedTrial:
    """The recording of a half, a sensor and a scene."""
    width, height = (int(each) for each in cfg.size.split("x"))
    seed, number = int(cfg.halves[job.half].seed), seed_number(job)
    world = instantiate(cfg.worlds[job.scene])
    return RenderedTrial(
        scene=world(height=height, width=width, seed=(seed, number, 0)),
        other=world(height=height, width=width, seed=(seed, number, 1)),
        sensor=instantiate(cfg.sensors[job.sensor]),
        windows=cfg.windows,
        key=(cfg.seed, seed, number),
        simulators={name: instantiate(each) for name, each in cfg.simulators.items()},
    )


def real_names(folder: Path) -> list[str]:
    """The recordings of a folder that have frames and another one of their size."""
    found = [*framed(folder).values()]
    sizes = [(each.height, each.width) for each in found]
    return [each.name for each, size in zip(found, sizes, strict=True) if sizes.count(size) > 1]


def framed(folder: Path) -> dict[str, Recording]:
    """The recordings below a folder that have frames, by name."""
    places = {
        name: each for name, each in find_recordings(folder).items() if frames_in(each.frames)
    }
    return {name: Recording.at(each) for name, each in places.items()}


def real_trial(cfg: DictConfig, job: Job) -> RealTrial:
    """A real recording, with another one for chance."""
    found = framed(Path(cfg.real))
    recording = found.pop(job.scene)
    size = recording.height, recording.width
    other = next(each for each in found.values() if (each.height, each.width) == size)
    times = recording.frame_times_us
    windows = (int(times[-1]) - int(times[0])) // WINDOW_US
    start, stop = int(times[0]), int(times[0]) + windows * WINDOW_US
    frames = np.stack([recording.read_frame(k) for k in range(len(times))])
    return RealTrial(
        events=_events(recording).window(start, stop),
        other=_events(other),
        frames=frames,
        frame_times_us=times,
        start_us=start,
        stop_us=stop,
        simulators={name: instantiate(each) for name, each in cfg.simulators.items()},
    )


def _events(recording: Recording) -> Events:
    with EventReader(recording.events_path, recording.height, recording.width) as reader:
        start, stop = reader.extent_us or (0, 0)
        return reader.window(start, stop)


def score(
    trial: RenderedTrial | RealTrial, judges: dict[str, Judge], means: dict[str, Path]
) -> dict[str, dict[str, NDArray[Any]]]:
    """By judge the scores of every challenger, and the sums by channel, of every stream."""
    reference = trial.reference()
    start = getattr(trial, "start_us", 0)
    starts = np.arange(start, trial.stop_us, WINDOW_US)
    tables: dict[str, list[dict[str, NDArray[Any]]]] = {name: [] for name in judges}
    statistics = {name: load_means(means[name]) for name in judges}
    silences = {name: Silence(judge.backbone) for name, judge in judges.items()}
    names: list[str] = []
    for group in _groups(trial.levels()):
        streams = [reference, *(level.make() for level in group)]
        names += [f"{level.kind}|{level.step}" for level in group]
        chunks = list(histogram_chunks(streams, starts, DEFINITION, 8))
        for name, judge in judges.items():
            tables[name].append(
                challenge(judge, silences[name], chunks, len(starts), statistics[name])
            )
    return {name: {"streams": np.array(names), **_joined(parts)} for name, parts in tables.items()}


def _groups(levels: Iterator[Level]) -> Iterator[list[Level]]:
    while group := list(islice(levels, AT_ONCE)):
        yield group


def challenge(
    judge: Judge,
    silence: Silence,
    chunks: Sequence[torch.Tensor],
    windows: int,
    means: Sequence[Means],
) -> dict[str, NDArray[Any]]:
    """Scores of a group of streams by challenger, with the state carried and reset."""
    skip = DEFINITION.warmup_of(windows)
    size = int(chunks[0].shape[-2]), int(chunks[0].shape[-1])
    found: dict[str, NDArray[Any]] = {}
    reset = Definition(state="reset")
    for definition, suffix in ((DEFINITION, ""), (reset, RESET)):
        tally, done = Challengers(means, skip), 0
        for chunk, pooled in paired(judge.backbone, chunks, [definition], "cpu"):
            quiet = silence.responses([definition], size, done, len(chunk))
            tally.add(pooled[definition.maps], quiet[definition.maps], done)
            done += len(chunk)
        scores = tally.scores()
        kept = scores if not suffix else {HEADLINE: scores[HEADLINE]}
        found |= {f"{name}{suffix}": values.numpy() for name, values in kept.items()}
        if not suffix:
            found |= {f"channels_{k}": each.numpy() for k, each in enumerate(tally.channels)}
    counted: dict[str, list[torch.Tensor]] = {}
    for chunk in chunks:
        for name, values in of_counts(chunk).items():
            counted.setdefault(name, []).append(values)
    found |= {name: torch.cat(parts)[skip:].mean(dim=0).numpy() for name, parts in counted.items()}
    return found


def _joined(parts: Sequence[dict[str, NDArray[Any]]]) -> dict[str, NDArray[Any]]:
    axis = {name: 1 if name.startswith("channels_") else 0 for name in parts[0]}
    return {n: np.concatenate([part[n] for part in parts], axis=a) for n, a in axis.items()}


def means_of(cfg: DictConfig, name: str, out: Path) -> Path:
    """The file of a judge's mean real features, of the references of the development half."""
    judge = Judge.load(name)
    plain: Any = OmegaConf.to_container(cfg, resolve=True)
    named = ("seed", "size", "windows", "halves", "scenes", "worlds", "sensors")
    key = short_hash([VERSION, judge.weights_sha256, *(plain[name] for name in named)])
    path = out / f"means-{Path(name).name}-{key}.npz"
    if path.is_file():
        return path
    half = cfg.halves.development
    jobs = [
        Job(plain, "development", sensor, scene, {})
        for scene in cfg.scenes
        for sensor in half.sensors
    ]
    moments = Moments()
    for job in track(jobs, description=f"mean features of {Path(name).name}"):
        made = rendered_trial(cfg, job)
        starts = np.arange(0, made.stop_us, WINDOW_US)
        chunks = list(histogram_chunks([made.reference()], starts, DEFINITION, 8))
        quiet, size, done = Silence(judge.backbone), chunks[0].shape[-2:], 0
        for pooled in pooled_features(judge.backbone, chunks, definitions=[DEFINITION]):
            stages = pooled[DEFINITION.maps]
            silent = quiet.responses([DEFINITION], (size[0], size[1]), done, len(stages[0]))
            moments.add(stages, silent[DEFINITION.maps])
            done += len(stages[0])
    save_means(path, moments.means())
    return path
