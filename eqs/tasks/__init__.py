"""What one step of training or evaluation does."""

from eqs.tasks.detection import DetectionTask, large_detections
from eqs.tasks.layers import SynchronisedNorms
from eqs.tasks.progress import EpochLines

__all__ = ["DetectionTask", "EpochLines", "SynchronisedNorms", "large_detections"]
