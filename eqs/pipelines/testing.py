"""Test finished detectors on events that they were not tested on when they were trained."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace

from hydra.utils import instantiate
from omegaconf import DictConfig

from eqs.data import Dataset, EventSource, LabelProtocol, MixedEvents, RecordedEvents, Recording
from eqs.files import one_at_a_time, short_hash
from eqs.metrics import Accuracy
from eqs.pipelines.build import event_source
from eqs.pipelines.detector import build_detector, record_of
from eqs.pipelines.runs import Run
from eqs.pipelines.sensors import Sensor
from eqs.training import DetectionTask

log = logging.getLogger(__name__)


def build_task(cfg: DictConfig, protocol: LabelProtocol, test_streams: list[str]) -> DetectionTask:
    """The configured detector in its training module."""
    model, record = build_detector(cfg), record_of(cfg)
    task: DetectionTask = instantiate(cfg.task)(
        model=model, protocol=protocol, test_streams=test_streams, record=record
    )
    return task


def streams_to_test(source: EventSource) -> dict[str, EventSource]:
    """The events to test on: those of the training, and the recorded ones where they differ."""
    own = source.evaluation if isinstance(source, MixedEvents) else source
    if isinstance(own, RecordedEvents):
        return {"real": own}
    return {"own": own, "real": RecordedEvents()}


def sees_real(source: EventSource) -> bool:
    """Whether a training on these events sees real ones, so that it depends on their sensor."""
    if isinstance(source, MixedEvents):
        seen = {source.evaluated_on, *(name for name, share in source.shares.items() if share)}
        return any(isinstance(source.sources[name], RecordedEvents) for name in seen)
    return isinstance(source, RecordedEvents)


@dataclass(frozen=True)
class TestsAlone:
    """The test recordings of a data set, with none to train on, whose events need not be there."""

    data: Dataset

    def recordings(self, split: str) -> list[Recording]:
        """The recordings of one split, none but those of test."""
        return self.data.recordings(split) if split == "test" else []


def accuracies(run: Run, data: Dataset, tests: Mapping[str, EventSource]) -> dict[str, Accuracy]:
    """What a finished detector finds in the test events of each stream, which are there already."""
    config = run.config()
    protocol = instantiate(config.protocol)
    task = build_task(config, protocol, list(tests))
    datamodule = instantiate(config.datamodule)(
        dataset=TestsAlone(data), protocol=protocol, source=RecordedEvents(), tests=tests
    )
    trainer = instantiate(
        config.trainer,
        devices=1,
        strategy="auto",
        logger=False,
        enable_checkpointing=False,
        enable_progress_bar=False,
    )
    trainer.test(task, datamodule, ckpt_path=run.weights, verbose=False)
    return {name: task.measured[name] for name in tests}


def on_other_sensor(run: Run, sensor: Sensor, data: Dataset, cfg: DictConfig) -> Run:
    """A run that saw no real events, with its accuracy on those of another sensor.

    It is measured once and kept beside the run's own result, until the test recordings change.

    Args:
        run: a finished run.
        sensor: the other sensor.
        data: the data set as that sensor sees it.
        cfg: says where simulated streams lie.
    """
    there, recordings = Run(run.folder, sensor.label), data.recordings("test")
    data.make_events(recordings)
    content = short_hash([recording.content_hash() for recording in recordings])
    with one_at_a_time(there.record, f"testing {run.folder} on {sensor.label}"):
        if there.finished and there.result.tested_on == content:
            return there
        log.info("testing %s on the events of %s", run.result.system, sensor.words)
        tests = streams_to_test(event_source(run.config().sim, cfg))
        for source in tests.values():
            source.prepare(recordings)
        found = accuracies(run, data, tests)
        own, real = found["own"], found["real"]
        tested = replace(run.result, own=own, real=real, sensor=sensor.label, tested_on=content)
        tested.save(there.record)
    return Run(run.folder, sensor.label)
