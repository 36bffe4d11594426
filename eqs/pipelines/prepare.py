"""Make what every training needs: the data set and the simulated streams."""

from __future__ import annotations

from omegaconf import DictConfig

from eqs.data import EventSource
from eqs.pipelines.build import Dataset, dataset, event_source
from eqs.pipelines.command import explained
from eqs.pipelines.timing import PhaseTimes, phase_times


@explained
def prepare(cfg: DictConfig) -> None:
    """Generate or check the data set, then run every configured simulator over it."""
    sources = [event_source(simulator, cfg) for simulator in cfg.simulators.values()]
    times = phase_times(cfg)
    data = prepare_data(cfg, times)
    for source in sources:
        prepare_stream(source, data, times)


def prepare_data(cfg: DictConfig, times: PhaseTimes) -> Dataset:
    """The data set, generated where it can be and is not there."""
    with times.measure("generate data", resumed=True):
        return dataset(cfg)


def prepare_stream(source: EventSource, data: Dataset, times: PhaseTimes) -> None:
    """The source's events of every recording."""
    with times.measure(f"simulate {source.name}", resumed=True):
        source.prepare(data.all_recordings())
