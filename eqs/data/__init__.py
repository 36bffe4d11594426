"""Data sets on disk: recordings, labels, sampling, batches."""

from importlib import import_module
from typing import TYPE_CHECKING

from eqs.data.augment import Augmentation, View
from eqs.data.dsec import DSECFolder, RecordingFolder, parse_size
from eqs.data.labels import LabelProtocol, detector_rows
from eqs.data.recording import Recording
from eqs.data.sampling import Chunk, Schedule, keyed_generator
from eqs.data.simulated import EventSource, RecordedEvents, SimulatedEvents
from eqs.data.windows import detection_windows, overlap_us, score_windows

if TYPE_CHECKING:
    from eqs.data.datamodule import EventDataModule, StepSampler
    from eqs.data.datasets import (
        Batch,
        Binning,
        EvaluationDataset,
        TrainingDataset,
        WindowSource,
    )

# These need torch, which the processes that simulate do without; they load at their first use.
_LATE = {
    "EventDataModule": "datamodule",
    "StepSampler": "datamodule",
    "Batch": "datasets",
    "Binning": "datasets",
    "EvaluationDataset": "datasets",
    "TrainingDataset": "datasets",
    "WindowSource": "datasets",
}

__all__ = [
    "Augmentation",
    "Batch",
    "Binning",
    "Chunk",
    "DSECFolder",
    "EvaluationDataset",
    "EventDataModule",
    "EventSource",
    "LabelProtocol",
    "RecordedEvents",
    "Recording",
    "RecordingFolder",
    "Schedule",
    "SimulatedEvents",
    "StepSampler",
    "TrainingDataset",
    "View",
    "WindowSource",
    "detection_windows",
    "detector_rows",
    "keyed_generator",
    "overlap_us",
    "parse_size",
    "score_windows",
]


def __getattr__(name: str) -> object:
    """Import a public name that needs torch."""
    if name in _LATE:
        return getattr(import_module(f"{__name__}.{_LATE[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
