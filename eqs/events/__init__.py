"""Event streams: the type, windows of it, and files of it."""

from eqs.events.store import EventReader, EventWriter
from eqs.events.stream import Events

__all__ = ["EventReader", "EventWriter", "Events"]
