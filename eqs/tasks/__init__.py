"""What one step of training or evaluation does."""

from eqs.tasks.detection import DetectionTask

__all__ = ["DetectionTask"]
