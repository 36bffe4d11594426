"""Render a street into a folder of frames, one after the other, each whole or not there."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
from hydra.utils import instantiate
from numpy.typing import NDArray
from omegaconf import DictConfig, OmegaConf
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from eqs.files import complete_file, one_at_a_time, read_json, write_json, write_text
from eqs.frames.times import TIMES
from eqs.pipelines.command import explained

log = logging.getLogger(__name__)
RECORD: Final = "render.json"
LONGEST_S: Final = 3600.0


class Scene(Protocol):
    """Anything that can be rendered.

    Args:
        version: what tells its pictures from those of other programs with the same settings.
    """

    version: str

    def photocurrent(self, t_us: float) -> NDArray[np.float32]:
        """The picture at a time, (H, W)."""


@explained
def render(cfg: DictConfig) -> None:
    """Render the frames that are missing in `cfg.out`, then write their times beside them.

    `render.json` says what they were rendered with and how bright the brightest is.

    Raises:
        ValueError: the folder holds frames of other settings, more frames than asked for, or what
            this command did not write; or no two frames are asked for.
    """
    out, times = Path(cfg.out), frame_times(cfg.frames_per_second, cfg.seconds)
    with one_at_a_time(out, f"rendering {out}"):
        scene = instantiate(cfg.scene, **asdict(instantiate(cfg.street)))
        description = {
            "scene": OmegaConf.to_container(cfg.scene, resolve=True),
            "street": OmegaConf.to_container(cfg.street, resolve=True),
            "frames_per_second": cfg.frames_per_second,
            "version": scene.version,
        }
        prepare_folder(out, description, len(times), overwrite=cfg.overwrite)
        paths = [frame_path(out, number) for number in range(len(times))]
        render_missing(scene, paths, times)
        brightest = max(float(np.load(path, mmap_mode="r").max()) for path in paths)
        write_text("".join(f"{time}\n" for time in times), out / TIMES)
        write_json(out / RECORD, {"description": description, "brightest": brightest})
    white = rounded_up(brightest)
    log.info("%s: %d frames; eqs simulate frames=%s white=%g", out, len(times), out, white)


def frame_times(frames_per_second: float, seconds: float) -> list[int]:
    """Times of the frames from zero on, whole microseconds.

    Raises:
        ValueError: there are no two of them, or more than the clock can tell apart.

    Example:
        >>> frame_times(400, 0.01)
        [0, 2500, 5000, 7500]
    """
    if not (0 < frames_per_second <= 1e6 and 0 < seconds <= LONGEST_S):
        raise ValueError(
            f"Expected a frame rate up to a million and a time up to {LONGEST_S:g} s, got "
            f"{frames_per_second} and {seconds}; set frames_per_second and seconds"
        )
    count = round(frames_per_second * seconds)
    if count < 2:
        raise ValueError(f"Expected at least two frames, got {count}; set seconds")
    return [round(number * 1e6 / frames_per_second) for number in range(count)]


def frame_path(folder: Path, number: int) -> Path:
    """Where a frame lies."""
    return folder / f"{number:06d}.npy"


def prepare_folder(out: Path, description: dict[str, Any], count: int, *, overwrite: bool) -> None:
    """Make sure that all frames in a folder are of these settings, and say so before the first.

    Raises:
        ValueError: they are not, or are too many, or nobody knows.
    """
    record = out / RECORD
    if not record.is_file():
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise ValueError(
                f"Expected a new folder at {out}, got what this command did not write; set out"
            )
    elif read_json(record).get("description") != description:
        if not overwrite:
            raise ValueError(
                f"Expected frames of these settings in {out}, got those of others, see {record}; "
                "set out, or overwrite=true to replace them"
            )
        for old in out.glob("*.npy"):
            old.unlink()
    there = len(list(out.glob("*.npy")))
    if there > count:
        raise ValueError(
            f"Expected at most {count} frames in {out}, got {there}; set seconds, or out"
        )
    if there < count:
        (out / TIMES).unlink(missing_ok=True)  # until all are there nobody takes them for a clip
    write_json(record, {"description": description})


def render_missing(scene: Scene, paths: Sequence[Path], times_us: Sequence[int]) -> None:
    """Render those frames that are not there, while a bar shows how fast."""
    missing = [(path, t) for path, t in zip(paths, times_us, strict=True) if not path.exists()]
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns) as progress:
        task = progress.add_task("rendering", total=len(paths))
        progress.update(task, completed=len(paths) - len(missing))
        for path, t in missing:
            picture = scene.photocurrent(t)
            with complete_file(path) as partial, partial.open("wb") as file:
                np.save(file, picture)
            progress.advance(task)


def rounded_up(value: float) -> float:
    """A number of three digits that is not below.

    Example:
        >>> rounded_up(312.41), rounded_up(0.0312), rounded_up(313.0)
        (313.0, 0.0312, 313.0)
    """
    step = 10.0 ** (math.floor(math.log10(value)) - 2) if value > 0 else 1.0
    up = math.ceil(round(value / step, 6)) * step
    return float(f"{up:.6g}")
