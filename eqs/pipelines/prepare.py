"""Make what every training needs: the data set and the simulated streams."""

from __future__ import annotations

import logging

from omegaconf import DictConfig

from eqs.data import Dataset, EventSource
from eqs.pipelines.build import dataset, event_source
from eqs.pipelines.command import explained
from eqs.pipelines.sensors import sensor_of
from eqs.pipelines.timing import PhaseTimes, phase_times

log = logging.getLogger(__name__)


@explained
def prepare(cfg: DictConfig) -> None:
    """Generate or check the data set, make its frames, and run every configured simulator."""
    sources = [event_source(simulator, cfg) for simulator in cfg.simulators.values()]
    times = phase_times(cfg)
    data = prepare_data(cfg, times)
    with times.measure("remap frames", resumed=True):
        data.make_frames()
    sensor = sensor_of(data)
    if sensor is not None:
        with times.measure("generate data", resumed=True):
            data.make_events(data.all_recordings())
        log.info("%s: %s", sensor.words, data.events_said())
    for source in sources:
        prepare_stream(source, data, times)
        source.prepare(data.scored_recordings())


def prepare_data(cfg: DictConfig, times: PhaseTimes) -> Dataset:
    """The data set, generated where it can be and is not there."""
    with times.measure("generate data", resumed=True):
        return dataset(cfg)


def prepare_stream(source: EventSource, data: Dataset, times: PhaseTimes) -> None:
    """The source's events of every recording."""
    with times.measure(f"simulate {source.name}", resumed=True):
        source.prepare(data.all_recordings())
