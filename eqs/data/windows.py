"""The stretches of time that detector and metric look at."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def detection_windows(
    frame_times_us: NDArray[np.int64], window_us: int = 50_000
) -> NDArray[np.int64]:
    """The windows that end at the second, third, ... frame.

    Convention: a label belongs to the end of its window, so the detector is asked about a frame
    once it has seen everything before it. Frames further apart than a window leave gaps, closer
    ones make windows overlap.

    Returns:
        Start and stop of each window, int64, shape (frames - 1, 2); none for fewer than two frames.

    Example:
        >>> detection_windows(np.array([0, 50_000, 100_001])).tolist()
        [[0, 50000], [50001, 100001]]
    """
    stops = np.asarray(frame_times_us, np.int64)[1:]
    return np.stack([stops - window_us, stops], axis=1)


def overlap_us(
    frame_times_us: NDArray[np.int64], events_start_us: int, events_stop_us: int
) -> tuple[int, int]:
    """The stretch that both frames and events cover; empty (stop = start) where they do not meet.

    The first frame may precede the first event and the last may follow the last one.
    """
    if len(frame_times_us) == 0:
        return events_start_us, events_start_us
    start = max(int(frame_times_us[0]), events_start_us)
    return start, max(start, min(int(frame_times_us[-1]), events_stop_us))
