"""From configuration to objects, the same way in every command."""

from __future__ import annotations

from pathlib import Path

from hydra.utils import instantiate
from omegaconf import DictConfig

from eqs.data import (
    Dataset,
    EventSource,
    GivenEvents,
    GivenStreams,
    RecordedEvents,
    SimulatedEvents,
)
from eqs.simulators import Simulator


def event_source(simulator: DictConfig, cfg: DictConfig) -> EventSource:
    """The events a configured simulator makes, given ones, or the recorded ones.

    Raises:
        ValueError: it is none of these.
    """
    built = instantiate(simulator)
    if isinstance(built, RecordedEvents):
        return built
    root = Path(cfg.paths.simulated) / cfg.data.name
    if isinstance(built, GivenEvents):
        return GivenStreams(built, root)
    if not isinstance(built, Simulator):
        raise ValueError(
            f"Expected a simulator or the recorded events, got a {type(built).__name__} from "
            f"{simulator.get('_target_')}; set sim=esim, sim=real or another of configs/sim"
        )
    return SimulatedEvents(built, root)


def dataset(cfg: DictConfig) -> Dataset:
    """The configured data set, generated or checked, ready to be read."""
    built: Dataset = instantiate(cfg.data)
    built.prepare()
    return built
