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


def seen_between_frames(
    frame_times_us: NDArray[np.int64], window_us: int = 50_000
) -> tuple[float, str]:
    """What windows that end at frames show of the time between them.

    Returns:
        Period of the frames by the length of the windows, and what follows from it in words, empty
        where they are alike within a fiftieth.

    Example:
        >>> seen_between_frames(np.arange(5) * 100_000)
        (2.0, 'frames are 100.0 ms apart and windows 50.0 ms long: 50 % of the events are not seen')
        >>> seen_between_frames(np.arange(5) * 50_000)
        (1.0, '')
    """
    period_us = float(np.median(np.diff(frame_times_us))) if len(frame_times_us) > 1 else window_us
    ratio = period_us / window_us
    lengths = f"frames are {period_us / 1e3:.1f} ms apart and windows {window_us / 1e3:.1f} ms long"
    if ratio > 1.02:
        return ratio, f"{lengths}: {100 * (1 - 1 / ratio):.0f} % of the events are not seen"
    if ratio < 0.98:
        return ratio, f"{lengths}: every event is seen {1 / ratio:.1f} times"
    return ratio, ""
