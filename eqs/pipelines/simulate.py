"""Simulate the events of one clip into one file, or those of a whole data set."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hydra.utils import instantiate
from omegaconf import DictConfig
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from eqs.content import content_hash, content_hashes
from eqs.data.simulated import write_stream
from eqs.events.writer import LONGEST_US
from eqs.files import one_at_a_time, read_json, short_hash, write_json
from eqs.frames import FrameFolder, VideoFile, image_paths
from eqs.frames.times import TIMES, counted_times, frame_times, times_file
from eqs.pipelines.build import dataset, event_source
from eqs.pipelines.command import explained
from eqs.pipelines.train_simulator import ensure_learned
from eqs.simulators import Simulator

log = logging.getLogger(__name__)


@explained
def simulate(cfg: DictConfig) -> None:
    """Simulate a clip into `cfg.out`, or every recording of a data set where trainings look for it.

    Raises:
        FileNotFoundError: there are no frames.
        ValueError: clip and data set are both given or both missing, the frames have no times, or
            the simulator is none.
    """
    simulator = instantiate(cfg.sim)
    if not isinstance(simulator, Simulator):
        raise ValueError(f"Expected a simulator, got sim={simulator.name}; set sim=esim or another")
    if (cfg.frames is None) == (cfg.data is None):
        found = "neither" if cfg.data is None else "both"
        raise ValueError(f"Expected a clip or a data set, got {found}; set frames or data")
    if cfg.data is None:
        ensure_learned(simulator)
        simulate_clip(simulator, cfg)
    else:
        simulate_dataset(cfg)


def simulate_dataset(cfg: DictConfig) -> None:
    """Simulate the recordings that are missing or were made otherwise."""
    recordings, source = dataset(cfg).all_recordings(), event_source(cfg.sim, cfg)
    source.prepare(recordings)
    folder = Path(cfg.paths.simulated) / cfg.data.name / source.label
    log.info("%s: events of %d recordings", folder, len(recordings))


def simulate_clip(simulator: Simulator, cfg: DictConfig) -> None:
    """Write `cfg.out`, a DSEC event file, from a folder of images or a video.

    Beside it lies `<out>.json`, which says how it was made; a file that was made the same way from
    the same frames is kept, any other is left alone unless `overwrite` is set.

    Raises:
        ValueError: something else is there already, a folder or the clip itself, or the clip is
            longer than a file can hold.
    """
    out, source = Path(cfg.out), Path(cfg.frames)
    if out.is_dir():
        raise ValueError(
            f"Expected a file to write at {out}, got a folder; set out={out}/events.h5"
        )
    if out.exists() and source.exists() and out.samefile(source):
        raise ValueError(f"Expected events beside the clip, got out={out} for both; set out")
    clip = open_clip(source, cfg.frames_per_second, cfg.white, cfg.time_unit, cfg.frame_numbers)
    check_times(clip)
    description = {
        "simulator": simulator.name,
        "parameters": simulator.parameters(),
        "version": simulator.version,
        "sequence": out.stem,
        "frames": contents(clip),
        "white": cfg.white,
    }
    record = out.with_name(out.name + ".json")
    if record.exists() and "description" not in read_json(record):
        raise ValueError(
            f"Expected a record of this command at {record}, got another file; set out"
        )
    with one_at_a_time(out, f"making {out}"):
        if out.exists() and not cfg.overwrite:
            refuse_others(out, record, description)
            log.info("%s is made of these frames already; overwrite=true makes it again", out)
            return
        frames, events = write_events(simulator, clip, out)
        made = {"events": events, "frames": frames, "file": content_hash(out)}
        write_json(record, {"description": description, **made})
    log.info("%s: %d events from %d frames", out, events, frames)


def refuse_others(out: Path, record: Path, description: Mapping[str, Any]) -> None:
    """Let nobody lose a file that was not made by this very command.

    Raises:
        ValueError: nothing says how the file was made, or it was made otherwise or changed since.
    """
    said = read_json(record) if record.is_file() else {}
    if said.get("file") != content_hash(out):
        found = "a file that this command did not write, or that was changed since"
    elif said.get("description") != description:
        found = "events made of other frames or with other parameters"
    else:
        return
    raise ValueError(
        f"Expected no other events at {out}, got {found}; set out, or overwrite=true to replace it"
    )


def check_times(clip: FrameFolder | VideoFile) -> None:
    """Refuse a clip whose events no file of DSEC's layout can hold, before it is simulated.

    Raises:
        ValueError: it is too long, or begins before zero.
    """
    if isinstance(clip, FrameFolder) and clip.timestamps_us[0] < 0:
        raise ValueError(
            f"Expected frame times of zero or more, got {clip.timestamps_us[0]} us for the first "
            f"frame; add {-clip.timestamps_us[0]} to every line of {TIMES}"
        )
    if clip.duration_us > LONGEST_US:
        raise ValueError(
            f"Expected a clip of at most a day, {LONGEST_US} us, got "
            f"{clip.duration_us} us; set frames to a part of it"
        )


def open_clip(
    source: Path,
    frames_per_second: float | None,
    white: float | None = None,
    time_unit: str | None = None,
    frame_numbers: bool | None = None,
) -> FrameFolder | VideoFile:
    """A folder of images with its times, or a video with those it carries.

    The times of a folder are those in `timestamps.txt` in or beside it, see `frame_times`; without
    that file they follow from the frame rate, see `counted_times`.

    Raises:
        ValueError: a folder has neither times nor a frame rate, or a video is given what only
            folders need.
    """
    if not source.is_dir():
        if frames_per_second is not None or time_unit is not None:
            raise ValueError(
                f"Expected no frame rate for {source}, whose frames carry times; leave "
                "frames_per_second and time_unit out"
            )
        return VideoFile(source)
    images = image_paths(source)
    file = times_file(source, time_unit) if frames_per_second is None else None
    if file is not None:
        return FrameFolder(images, frame_times(*file, images), white=white)
    if frames_per_second is None or not frames_per_second > 0:
        raise ValueError(
            f"Expected {TIMES} in {source} or beside it, or a frame rate above zero, got "
            f"{frames_per_second!r}; set frames_per_second"
        )
    times_us = counted_times(images, frames_per_second, frame_numbers)
    return FrameFolder(images, times_us, white=white)


def write_events(simulator: Simulator, clip: FrameFolder | VideoFile, out: Path) -> tuple[int, int]:
    """Simulate a clip while a bar shows how fast; returns the numbers of frames and events."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rates]}"),
        TimeRemainingColumn(),
    )
    with Progress(*columns) as progress:
        task = progress.add_task(simulator.name, total=len(clip) or None, rates="")

        def follow(frames: int, events: int) -> None:
            so_far = rates(progress.tasks[0].elapsed, frames, events)
            progress.update(task, completed=frames, rates=so_far)

        return write_stream(simulator, out.stem, clip, out, follow)


def rates(seconds: float | None, frames: int, events: int) -> str:
    """Frames and events per second so far, in words."""
    if not seconds:
        return ""
    return f"{frames / seconds:.0f} frames/s, {events / seconds / 1e6:.2f} Mev/s"


def contents(clip: FrameFolder | VideoFile) -> str:
    """What tells one clip from another: what its files hold, and the times of its frames."""
    if isinstance(clip, VideoFile):
        return content_hash(clip.path)
    return short_hash([clip.timestamps_us.tolist(), content_hashes(clip.paths)])
