"""The procedural driving world and the two cameras that make `dsec_mini`."""

from eqs.scenes.camera import Exposure, FrameCamera
from eqs.scenes.generate import DSECMini, Recording
from eqs.scenes.labels import TRACK_DTYPE, LabelRule
from eqs.scenes.sensor import ReferenceSensor, ReferenceStream
from eqs.scenes.world import DrivingWorld, View

__all__ = [
    "TRACK_DTYPE",
    "DSECMini",
    "DrivingWorld",
    "Exposure",
    "FrameCamera",
    "LabelRule",
    "Recording",
    "ReferenceSensor",
    "ReferenceStream",
    "View",
]
