"""Rendered worlds, the street of `dsec_mini` and scenes of other kinds, and their cameras."""

from eqs.scenes.camera import Exposure, FrameCamera
from eqs.scenes.first_order import FirstOrderSensor
from eqs.scenes.generate import DSECMini
from eqs.scenes.labels import TRACK_DTYPE, LabelRule
from eqs.scenes.lessons import Lesson, Lessons
from eqs.scenes.objects import FLICKER, HAND_HELD, NEARLY_STILL, PASSING, Manner, ObjectScene
from eqs.scenes.plan import Street
from eqs.scenes.scene_light import SceneLight
from eqs.scenes.scenery import PaintedStreet, recorded_street
from eqs.scenes.sensor import ReferenceSensor, ReferenceStream
from eqs.scenes.sensor_stream import EventSensor, SensorStream
from eqs.scenes.sequence import SequencePlan
from eqs.scenes.world import ActorsInView, DrivingWorld

__all__ = [
    "FLICKER",
    "HAND_HELD",
    "NEARLY_STILL",
    "PASSING",
    "TRACK_DTYPE",
    "ActorsInView",
    "DSECMini",
    "DrivingWorld",
    "EventSensor",
    "Exposure",
    "FirstOrderSensor",
    "FrameCamera",
    "LabelRule",
    "Lesson",
    "Lessons",
    "Manner",
    "ObjectScene",
    "PaintedStreet",
    "ReferenceSensor",
    "ReferenceStream",
    "SceneLight",
    "SensorStream",
    "SequencePlan",
    "Street",
    "recorded_street",
]
