"""The part of a stream that a representation shows."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from eqs.events import Events

Span = Literal["window", "events"]  # what time is a share of: the window, or first to last event


def events_inside(events: Events, start_us: int | None, stop_us: int | None, span: Span) -> Events:
    """The part of the stream inside a window whose ends may be open.

    Raises:
        ValueError: the window is empty, or the span is an unknown one.
    """
    if span not in get_args(Span):
        raise ValueError(f"Expected span to be 'window' or 'events', got {span!r}")
    if start_us is not None and stop_us is not None and start_us >= stop_us:
        raise ValueError(
            f"Expected a window that ends after it starts, got [{start_us}, {stop_us}) us"
        )
    first = 0 if start_us is None else int(np.searchsorted(events.t, start_us, side="left"))
    last = len(events) if stop_us is None else int(np.searchsorted(events.t, stop_us, side="left"))
    return events[first:last]
