"""Detectors: what a training asks of one, RVT from backbone to loss, checkpoints."""

from eqs.models.backbone import TAPS, RVTBackbone
from eqs.models.detector import SIZES, RVTDetector, backbone_from_checkpoint
from eqs.models.loss import detection_loss
from eqs.models.postprocess import Detections, postprocess
from eqs.models.protocol import Detector
from eqs.models.states import States, detach_states, gather_frames, reset_states
from eqs.models.synchronised import SyncBatchNorm
from eqs.models.trained import Geometry, TrainedDetector, load_detector

__all__ = [
    "SIZES",
    "TAPS",
    "Detections",
    "Detector",
    "Geometry",
    "RVTBackbone",
    "RVTDetector",
    "States",
    "SyncBatchNorm",
    "TrainedDetector",
    "backbone_from_checkpoint",
    "detach_states",
    "detection_loss",
    "gather_frames",
    "load_detector",
    "postprocess",
    "reset_states",
]
