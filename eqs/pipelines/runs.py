"""Trained detectors on disk: one folder per run, finished when its result.json is there."""

from __future__ import annotations

import logging
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf

from eqs.files import complete_file, read_json, write_json
from eqs.pipelines.result import RunResult

log = logging.getLogger(__name__)
REPLACED = ".replaced"  # ends the name of a finished run that is about to be trained anew


@dataclass(frozen=True)
class Run:
    """The folder of one training.

    Args:
        folder: `<runs>/<data>/<stream>/<recipe and data>-seed<seed>`.
        sensor: the event camera on whose events it was tested, where that is another than those
            that the training was tested on.
    """

    folder: Path
    sensor: str = ""

    @property
    def checkpoints(self) -> Path:
        """Folder of the checkpoints."""
        return self.folder / "checkpoints"

    @property
    def last_checkpoint(self) -> Path:
        """The newest checkpoint, whether it exists or not."""
        return self.checkpoints / "last.ckpt"

    @property
    def weights(self) -> Path:
        """The finished detector's weights."""
        return self.folder / "weights.ckpt"

    @property
    def record(self) -> Path:
        """What was measured, whether it exists or not."""
        return self.folder / f"result{'-' * bool(self.sensor)}{self.sensor}.json"

    @property
    def finished(self) -> bool:
        """Whether training and testing are complete."""
        return self.record.exists()

    @property
    def finished_ns(self) -> int:
        """When it was finished, nanoseconds since 1970."""
        return self.record.stat().st_mtime_ns

    @cached_property
    def result(self) -> RunResult:
        """What the finished run measured.

        Raises:
            ValueError: the record lacks something, as those of older versions may.
        """
        return RunResult.load(self.record)

    @property
    def _replaced(self) -> Run:
        return Run(self.folder.with_name(self.folder.name + REPLACED))

    def put_aside(self) -> None:
        """Make room for a training that replaces this one, whose result stays until it is there."""
        if self.finished:
            shutil.rmtree(self._replaced.folder, ignore_errors=True)
            self.folder.rename(self._replaced.folder)
        else:
            shutil.rmtree(self.folder, ignore_errors=True)

    def finish(self, result: RunResult) -> None:
        """Mark the run as finished; the one that it replaces, if any, goes."""
        result.save(self.record)
        shutil.rmtree(self._replaced.folder, ignore_errors=True)

    def recipe(self) -> dict[str, Any]:
        """Every setting of the training by its key, as it was begun; none in older runs."""
        path = self.folder / "recipe.json"
        return read_json(path) if path.is_file() else {}

    def config(self) -> DictConfig:
        """The configuration the run was started with."""
        config = OmegaConf.load(self.folder / "config.yaml")
        if not isinstance(config, DictConfig):
            raise ValueError(f"Expected a configuration in {self.folder}, got a list; delete it")
        return config

    def save_config(self, cfg: DictConfig, recipe: Mapping[str, Any]) -> None:
        """Keep what the run was asked, with every interpolation resolved."""
        with complete_file(self.folder / "config.yaml") as partial:
            OmegaConf.save(cfg, partial, resolve=True)
        write_json(self.folder / "recipe.json", recipe)


def finished_runs(root: Path) -> Iterator[Run]:
    """Every finished run of one data set, in the order of their names.

    A run that is being trained anew counts as it was; what cannot be read is named and left out.
    """
    for path in sorted(root.glob("*/*/result.json")):
        run = Run(path.parent)
        anew = Run(run.folder.with_name(run.folder.name.removesuffix(REPLACED)))
        if anew.folder != run.folder and anew.finished:
            continue
        try:
            _ = run.result
        except ValueError as error:
            log.warning("left out: %s", error)
            continue
        yield run
