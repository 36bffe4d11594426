"""Data sets on disk: recordings, labels, simulated streams."""

from eqs.data.converted import converted
from eqs.data.dataset import Dataset
from eqs.data.dsec import DSECFolder, parse_size
from eqs.data.event_view import EventView
from eqs.data.given import GivenEvents, GivenStreams
from eqs.data.label_files import ArrayLabels, CocoLabels, YoloLabels
from eqs.data.labels import LabelProtocol, detector_rows
from eqs.data.mixed import Mix, MixedEvents
from eqs.data.own import OwnDataset
from eqs.data.recording import Recording
from eqs.data.simulated import EventSource, RecordedEvents, SimulatedEvents
from eqs.data.unlabelled import RecordingFolder
from eqs.data.windows import detection_windows, seen_between_frames

__all__ = [
    "ArrayLabels",
    "CocoLabels",
    "DSECFolder",
    "Dataset",
    "EventSource",
    "EventView",
    "GivenEvents",
    "GivenStreams",
    "LabelProtocol",
    "Mix",
    "MixedEvents",
    "OwnDataset",
    "RecordedEvents",
    "Recording",
    "RecordingFolder",
    "SimulatedEvents",
    "YoloLabels",
    "converted",
    "detection_windows",
    "detector_rows",
    "parse_size",
    "seen_between_frames",
]
