"""What one step of training or evaluation does."""

from eqs.tasks.detection import DetectionTask
from eqs.tasks.progress import EpochLines

__all__ = ["DetectionTask", "EpochLines"]
