"""Event streams: the type, windows of it, and files of it."""

from eqs.events.stream import Events

__all__ = ["Events"]
