"""Baselines that only look at times: intervals between events, and the beat of the frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from eqs.events import Events


def interval_distance(simulated: Events, real: Events) -> float:
    """Wasserstein distance between the pixels' inter-event intervals, in decades; 0 is best.

    Convention: intervals are between successive events of one pixel, whatever their polarity, and
    at least 1 us. A stream without any counts as one interval as long as the longer stream.
    """
    longest = max(float(each.t[-1] - each.t[0]) if len(each) else 1.0 for each in (simulated, real))
    first, second = (
        np.log10(np.maximum(intervals, 1.0)) if len(intervals) else np.log10([max(longest, 1.0)])
        for intervals in (pixel_intervals(simulated), pixel_intervals(real))
    )
    return float(stats.wasserstein_distance(first, second))


def pixel_intervals(events: Events) -> NDArray[np.int64]:
    """Time from each event to the next one of its pixel, in microseconds, pixel by pixel."""
    pixel = events.y.astype(np.int64) * events.width + events.x
    order = np.argsort(pixel, kind="stable")
    pixel, times = pixel[order], events.t[order]
    intervals: NDArray[np.int64] = np.diff(times)[pixel[1:] == pixel[:-1]]
    return intervals


def phase_locking_error(
    simulated: Events, real: Events, frame_times_us: NDArray[np.int64]
) -> float:
    """Difference of how strongly either stream keeps the beat of the frames, in [0, 1]; 0 is best.

    Convention: the strength is the length of the mean phase vector of all events between the
    first and the last frame, 1 if all fall on one phase, 0 without events. An event's phase is
    its place between the frame before it and the one after.
    """
    return abs(beat(simulated, frame_times_us) - beat(real, frame_times_us))


def beat(events: Events, frame_times_us: NDArray[np.int64]) -> float:
    """Length of the mean phase vector of a stream; see `phase_locking_error`."""
    inside = events.window(int(frame_times_us[0]), int(frame_times_us[-1]))
    if not len(inside):
        return 0.0
    frame = np.searchsorted(frame_times_us, inside.t, side="right") - 1
    start = frame_times_us[frame]
    phase = (inside.t - start) / (frame_times_us[frame + 1] - start)
    return float(abs(np.exp(2j * np.pi * phase).mean()))
