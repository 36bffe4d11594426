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
    Mix,
    MixedEvents,
    RecordedEvents,
    SimulatedEvents,
)
from eqs.pipelines.train_simulator import ensure_learned
from eqs.simulators import Simulator


def event_source(simulator: DictConfig, cfg: DictConfig) -> EventSource:
    """The events a configured simulator makes, given ones, the recorded ones, or several mixed.

    Raises:
        ValueError: it is none of these.
    """
    built = instantiate(simulator)
    ensure_learned(built)
    root = Path(cfg.paths.simulated) / cfg.data.name
    return mixed(built, root) if isinstance(built, Mix) else source_of(built, root)


def source_of(built: object, root: Path) -> EventSource:
    """The event source of what a configuration names.

    Args:
        built: a simulator, given events or the recorded ones.
        root: folder for the streams of one data set.

    Raises:
        ValueError: it is none of these.
    """
    if isinstance(built, RecordedEvents):
        return built
    if isinstance(built, GivenEvents):
        return GivenStreams(built, root)
    if not isinstance(built, Simulator):
        raise ValueError(
            "Expected a simulator, given or recorded events, got a "
            f"{type(built).__name__}; set sim=esim, sim=real or another of configs/sim"
        )
    return SimulatedEvents(built, root)


def mixed(mix: Mix, root: Path) -> MixedEvents:
    """The event source of a mix.

    Raises:
        ValueError: a stream of it is no single one.
    """
    shares = {name: float(stream["share"]) for name, stream in mix.streams.items()}
    return MixedEvents(
        sources={name: source_of(each["events"], root) for name, each in mix.streams.items()},
        shares=shares,
        evaluated_on=mix.evaluated_on or next(name for name, share in shares.items() if share),
        seed=mix.seed,
    )


def dataset(cfg: DictConfig) -> Dataset:
    """The configured data set, generated or checked, ready to be read."""
    built: Dataset = instantiate(cfg.data)
    built.prepare()
    return built
