"""Training a detector: windows, batches, augmentation, and what one step does."""

from eqs.training.augmentation import Augmentation, View
from eqs.training.checkpoints import IDENTITY, CompleteCheckpoints, Identity
from eqs.training.datamodule import EventDataModule, StepSampler
from eqs.training.datasets import Batch, EvaluationDataset, TrainingDataset
from eqs.training.layers import SynchronisedNorms
from eqs.training.pictures import DetectionPictures
from eqs.training.progress import EpochLines
from eqs.training.sampling import Chunk, Schedule, keyed_generator
from eqs.training.selection import Selection, boxes_of
from eqs.training.task import DetectionTask
from eqs.training.window_source import Binning, WindowSource

__all__ = [
    "IDENTITY",
    "Augmentation",
    "Batch",
    "Binning",
    "Chunk",
    "CompleteCheckpoints",
    "DetectionPictures",
    "DetectionTask",
    "EpochLines",
    "EvaluationDataset",
    "EventDataModule",
    "Identity",
    "Schedule",
    "Selection",
    "StepSampler",
    "SynchronisedNorms",
    "TrainingDataset",
    "View",
    "WindowSource",
    "boxes_of",
    "keyed_generator",
]
