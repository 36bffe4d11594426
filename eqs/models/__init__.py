"""RVT detectors: backbone, pyramid, head, loss, postprocessing, checkpoints."""

from eqs.models.backbone import TAPS, RVTBackbone
from eqs.models.detector import SIZES, RVTDetector, backbone_from_checkpoint
from eqs.models.loss import detection_loss
from eqs.models.postprocess import Detections, postprocess
from eqs.models.states import States, detach_states, gather_frames, reset_states
from eqs.models.synchronised import SyncBatchNorm

__all__ = [
    "SIZES",
    "TAPS",
    "Detections",
    "RVTBackbone",
    "RVTDetector",
    "States",
    "SyncBatchNorm",
    "backbone_from_checkpoint",
    "detach_states",
    "detection_loss",
    "gather_frames",
    "postprocess",
    "reset_states",
]
