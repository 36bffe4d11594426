"""The procedural driving world and the two cameras that make `dsec_mini`."""

from eqs.scenes.camera import Exposure, FrameCamera
from eqs.scenes.generate import DSECMini, SequencePlan
from eqs.scenes.labels import TRACK_DTYPE, LabelRule
from eqs.scenes.scene_light import SceneLight
from eqs.scenes.sensor import ReferenceSensor, ReferenceStream
from eqs.scenes.world import ActorsInView, DrivingWorld

__all__ = [
    "TRACK_DTYPE",
    "ActorsInView",
    "DSECMini",
    "DrivingWorld",
    "Exposure",
    "FrameCamera",
    "LabelRule",
    "ReferenceSensor",
    "ReferenceStream",
    "SceneLight",
    "SequencePlan",
]
