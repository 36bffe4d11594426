"""Trained detectors on disk: one folder per run, finished when its result.json is there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from omegaconf import DictConfig, OmegaConf

from eqs import __version__
from eqs.files import short_hash
from eqs.pipelines.result import RunResult

# What makes two detectors comparable: everything a training depends on but stream and seed ...
RECIPE_KEYS = ("data", "protocol", "model", "recipe", "datamodule", "task")
# ... and nothing that only says where files lie or how many processes read them.
INCIDENTAL = {"data": {"root", "workers"}, "datamodule": {"seed", "num_workers", "histogram_cache"}}


def recipe_hash(cfg: DictConfig) -> str:
    """Hash of the training recipe: equal for runs that differ only in stream and seed."""
    recipe = {
        key: {
            name: OmegaConf.to_container(value, resolve=True)
            if OmegaConf.is_config(value)
            else value
            for name, value in cfg[key].items()
            if name not in INCIDENTAL.get(key, ())
        }
        for key in RECIPE_KEYS
    }
    return short_hash({**recipe, "version": __version__})


@dataclass(frozen=True)
class Run:
    """The folder of one training.

    Args:
        folder: `<runs>/<data>/<stream>/<recipe>-seed<seed>`.
    """

    folder: Path

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
    def finished(self) -> bool:
        """Whether training and testing are complete."""
        return (self.folder / "result.json").exists()

    @property
    def finished_ns(self) -> int:
        """When it was finished, nanoseconds since 1970."""
        return (self.folder / "result.json").stat().st_mtime_ns

    @cached_property
    def result(self) -> RunResult:
        """What the finished run measured.

        Raises:
            ValueError: the record lacks something, as those of older versions may.
        """
        return RunResult.load(self.folder / "result.json")

    def finish(self, result: RunResult) -> None:
        """Mark the run as finished."""
        result.save(self.folder / "result.json")

    def config(self) -> DictConfig:
        """The configuration the run was started with."""
        config = OmegaConf.load(self.folder / "config.yaml")
        if not isinstance(config, DictConfig):
            raise ValueError(f"Expected a configuration in {self.folder}, got a list; delete it")
        return config

    def save_config(self, cfg: DictConfig) -> None:
        """Keep what the run was asked, with every interpolation resolved."""
        self.folder.mkdir(parents=True, exist_ok=True)
        OmegaConf.save(cfg, self.folder / "config.yaml", resolve=True)


def finished_runs(root: Path) -> Iterator[Run]:
    """Every finished run of one data set, in the order of their names."""
    for path in sorted(root.glob("*/*/result.json")):
        yield Run(path.parent)
