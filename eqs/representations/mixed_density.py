"""A stack whose channels look back over halving stretches of time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eqs.events import Events
from eqs.representations.window import Span, events_inside

NEAR_ZERO = np.float32(1e-6)  # keeps the logarithm finite at both ends of a window


def mixed_density_stack(
    events: Events,
    bins: int = 10,
    start_us: int | None = None,
    stop_us: int | None = None,
    cutoff: int | None = 32,
    span: Span = "window",
    wrap: bool = False,
) -> NDArray[np.int8]:
    """Sum the polarities of a window over stretches of time, the newest the longest.

    The newest half of the window is the last bin, the quarter before it the one before, and so on;
    channel k is the sum of the bins 0 to k, so that the last channel holds every event and an early
    one only the oldest.

    Convention: brighter counts +1, darker -1. Time is a share of `[start_us, stop_us)`, or with
    `span="events"` of the time from the first to the last event, as published.

    Args:
        events: a time-sorted stream; events outside the window are left out.
        bins: number of channels.
        start_us: start of the window; by default the first event's time.
        stop_us: end of the window (not part of it); by default one past the last event's time.
        cutoff: sums stop here in either direction; None is the most a byte can hold.
        span: what the stretches divide.
        wrap: let sums wrap as bytes do before the cutoff applies, as the published program does.

    Returns:
        int8, shape (bins, height, width).

    Raises:
        ValueError: the window is empty, or `bins` or `cutoff` is out of range.

    Source: Nam et al., "Stereo Depth from Events Cameras: Concentrate and Focus on the Future",
    CVPR 2022, as in RVT's released program.

    Example:
        >>> events = Events.from_arrays(t=[10, 90], x=[0, 1], y=[0, 0], p=[0, 1], height=1, width=2)
        >>> mixed_density_stack(events, bins=3, start_us=0, stop_us=100)[:, 0].tolist()
        [[-1, 0], [-1, 0], [-1, 1]]
    """
    limit = 127 if cutoff is None else cutoff
    if bins < 1 or not 0 <= limit <= 127:
        raise ValueError(
            f"Expected at least 1 bin and a cutoff from 0 to 127, got {bins} and {cutoff}"
        )
    events = events_inside(events, start_us, stop_us, span)
    sums = np.zeros((bins, events.height, events.width), np.int64)
    if len(events):
        start, stop = int(events.t[0]), int(events.t[-1])
        if span == "window":
            start = start if start_us is None else start_us
            stop = stop + 1 if stop_us is None else stop_us
        where = (_stretches(events.t - start, max(stop - start, 1), bins), events.y, events.x)
        np.add.at(sums, where, 2 * events.p.astype(np.int64) - 1)
    sums = sums.cumsum(axis=0)
    if wrap:
        sums = sums.astype(np.int8)
    return np.clip(sums, -limit, limit).astype(np.int8)


def _stretches(elapsed_us: NDArray[np.int64], span_us: int, bins: int) -> NDArray[np.int64]:
    """Bin of each event, in float32 as published."""
    share = elapsed_us.astype(np.float32) / np.float32(span_us)
    share = np.clip(share, NEAR_ZERO, np.float32(1) - NEAR_ZERO)
    halvings = np.log(share) / np.log(np.float32(0.5))
    stretches: NDArray[np.int64] = np.floor(np.maximum(bins - halvings, 0)).astype(np.int64)
    return stretches
