"""Data sets on disk: recordings, labels, simulated streams."""

from eqs.data.dataset import Dataset
from eqs.data.dsec import DSECFolder, RecordingFolder, parse_size
from eqs.data.event_view import EventView
from eqs.data.given import GivenEvents, GivenStreams
from eqs.data.labels import LabelProtocol, detector_rows
from eqs.data.recording import Recording
from eqs.data.simulated import EventSource, RecordedEvents, SimulatedEvents
from eqs.data.windows import detection_windows, seen_between_frames

__all__ = [
    "DSECFolder",
    "Dataset",
    "EventSource",
    "EventView",
    "GivenEvents",
    "GivenStreams",
    "LabelProtocol",
    "RecordedEvents",
    "Recording",
    "RecordingFolder",
    "SimulatedEvents",
    "detection_windows",
    "detector_rows",
    "parse_size",
    "seen_between_frames",
]
