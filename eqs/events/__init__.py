"""Event streams: the type, windows of it, and files of it."""

from eqs.events.hints import Hints
from eqs.events.reader import EventReader
from eqs.events.stream import Events
from eqs.events.writer import EventWriter

__all__ = ["EventReader", "EventWriter", "Events", "Hints"]
