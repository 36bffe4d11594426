"""From configuration to objects, the same way in every command."""

from __future__ import annotations

from pathlib import Path

from hydra.utils import instantiate
from omegaconf import DictConfig

from eqs.data import DSECFolder, EventSource, RecordedEvents, RecordingFolder, SimulatedEvents
from eqs.simulators import Simulator

Dataset = DSECFolder | RecordingFolder


def event_source(simulator: DictConfig, cfg: DictConfig) -> EventSource:
    """The events a configured simulator makes, or the recorded ones where it is none."""
    built = instantiate(simulator)
    if not isinstance(built, Simulator):
        return RecordedEvents()
    return SimulatedEvents(built, Path(cfg.paths.simulated) / cfg.data.name)


def dataset(cfg: DictConfig) -> Dataset:
    """The configured data set, generated or checked, ready to be read."""
    built = instantiate(cfg.data)
    built.prepare()
    return built
