"""A stream in memory that is read like a file."""

from __future__ import annotations

from typing import Self

from eqs.events.stream import Events


class LoadedEvents:
    """A stream in memory with the interface of `EventReader`, for files without an index.

    Args:
        events: the whole stream.
        rows: number of rows, counted from the top, to keep; all of them if None.
    """

    def __init__(self, events: Events, rows: int | None = None) -> None:
        """Keep the stream."""
        keep = min(rows or events.height, events.height)
        if keep < events.height:
            inside = events.y < keep
            parts = {name: getattr(events, name)[inside] for name in "txyp"}
            events = Events(**parts, height=keep, width=events.width, span_us=events.span_us)
        self.events = events
        self.height, self.width, self.span_us = events.height, events.width, events.span_us
        self.extent_us = events.extent_us
        self.start_us, self.stop_us = self.extent_us or (0, 0)

    def __enter__(self) -> Self:
        """Nothing to open."""
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing to close."""

    def __len__(self) -> int:
        """Number of events."""
        return len(self.events)

    def window(self, start_us: int, stop_us: int) -> Events:
        """The events with `start_us <= t < stop_us`."""
        return self.events.window(start_us, stop_us)
