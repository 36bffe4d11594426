"""The tensor that detector and metric share: counts of events per time bin, polarity and pixel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eqs.events import Events
from eqs.kernels import njit
from eqs.representations.window import Span, events_inside

HISTOGRAM_VERSION = 1
"""Raised whenever equal events begin to give other counts; stored histograms are named by it."""


def stacked_histogram(
    events: Events,
    bins: int = 10,
    start_us: int | None = None,
    stop_us: int | None = None,
    count_cutoff: int | None = 10,
    span: Span = "window",
    wrap: bool = False,
) -> NDArray[np.uint8]:
    """Count the events of one window per polarity, time bin and pixel.

    Convention: channel `p * bins + bin`, so negative polarity first. With `span="window"` the bins
    divide `[start_us, stop_us)`, `bin = (t - start) * bins // (stop - start)` in whole numbers, so
    a silent part of the window stays visible as such. With `span="events"` they divide the time
    from the first to the last event inside it, in float32, as the published detector was trained:
    the same motion then looks faster the later it starts.

    Args:
        events: a time-sorted stream; events outside the window are left out.
        bins: time bins per polarity.
        start_us: start of the window; by default the first event's time.
        stop_us: end of the window (not part of it); by default one past the last event's time.
        count_cutoff: a count stops growing here; None is the most a byte can hold.
        span: what the time bins divide.
        wrap: let counts wrap at 256 before the cutoff applies, as the published program does.

    Returns:
        uint8, shape (2 * bins, height, width).

    Raises:
        ValueError: the window is empty, or `bins` or `count_cutoff` is not positive.

    Source: Gehrig and Scaramuzza, "Recurrent Vision Transformers for Object Detection with Event
    Cameras", CVPR 2023, section 3.1 and released program.

    Example:
        >>> events = Events.from_arrays(t=[0, 60], x=[0, 1], y=[0, 0], p=[0, 1], height=1, width=2)
        >>> stacked_histogram(events, bins=2, start_us=0, stop_us=100)[:, 0].tolist()
        [[1, 0], [0, 0], [0, 0], [0, 1]]
    """
    cutoff = 255 if count_cutoff is None else min(count_cutoff, 255)
    if bins < 1 or cutoff < 1:
        raise ValueError(
            f"Expected bins and count_cutoff of at least 1, got {bins} and {count_cutoff}; "
            "set both to positive numbers"
        )
    events = events_inside(events, start_us, stop_us, span)
    histogram = np.zeros((2, bins, events.height, events.width), np.uint8)
    if len(events):
        if span == "window":
            start = int(events.t[0]) if start_us is None else start_us
            stop = int(events.t[-1]) + 1 if stop_us is None else stop_us
            firsts = _window_bins(events.t, bins, start, stop)
        else:
            firsts = _event_bins(events.t, bins)
        _count(histogram, firsts, events.x, events.y, events.p, np.uint8(cutoff), wrap)
    if wrap:
        np.minimum(histogram, cutoff, out=histogram)
    return histogram.reshape(2 * bins, events.height, events.width)


def _window_bins(t: NDArray[np.int64], bins: int, start: int, stop: int) -> NDArray[np.int64]:
    """Index of the first event of every bin, and the number of events.

    Events are sorted, so a search for the bins' edges replaces a division per event. An edge is
    the earliest whole microsecond whose bin number is b, `start + ceil(b * span / bins)`.
    """
    numbers = np.arange(bins, dtype=np.int64)
    edges = start - (-numbers * (stop - start)) // bins
    return np.append(np.searchsorted(t, edges, side="left"), len(t))


def _event_bins(t: NDArray[np.int64], bins: int) -> NDArray[np.int64]:
    """The same for bins from the first to the last event, rounded as the published program does."""
    elapsed = (t - t[0]).astype(np.float32)
    span = np.float32(max(int(t[-1] - t[0]), 1))
    number = np.minimum(np.floor(elapsed / span * np.float32(bins)), bins - 1)
    return np.append(np.searchsorted(number, np.arange(bins), side="left"), len(t))


@njit(cache=True)
def _count(
    histogram: NDArray[np.uint8],
    firsts: NDArray[np.int64],
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    p: NDArray[np.uint8],
    cutoff: np.uint8,
    wrap: bool,
) -> None:
    """Add one per event, stopping at the cutoff, or modulo 256.

    One bin after the other keeps the cache warm.
    """
    for number in range(len(firsts) - 1):
        for i in range(firsts[number], firsts[number + 1]):
            count = histogram[p[i], number, y[i], x[i]]
            histogram[p[i], number, y[i], x[i]] = count + (wrap or count < cutoff)
