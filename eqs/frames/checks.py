"""What may be called a clip: frames of one size with times that increase."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.clock import backwards

WHITE = 255.0


def checked_frames(frames: Any, white: float = WHITE) -> NDArray[Any]:  # noqa: ANN401 - whatever a caller has
    """Return the frames as an array, uint8 or floating, grey `(N, H, W)` or RGB `(N, H, W, 3)`.

    Convention: grey levels run from 0 to 255 in what is returned; floating ones that are given run
    from 0 to `white`.

    Raises:
        ValueError: the sizes differ, or the type, shape or a value is none of a clip's.
    """
    try:
        array = np.asarray(frames)
    except ValueError:
        sizes = sorted({np.shape(frame) for frame in frames})
        raise ValueError(f"Expected frames of one size, got {sizes}; resize them first") from None
    if array.dtype != np.uint8 and array.dtype.kind != "f":
        raise ValueError(
            f"Expected frames of type uint8, or floating with grey levels 0..255, got "
            f"{array.dtype}; convert them with frames.astype"
        )
    if array.ndim not in (3, 4) or (array.ndim == 4 and array.shape[3] != 3):
        raise ValueError(
            f"Expected frames shaped (N, H, W) grey or (N, H, W, 3) RGB, got {array.shape}; "
            "a single frame needs a leading axis"
        )
    if 0 in array.shape[1:]:
        raise ValueError(f"Expected frames with at least one pixel, got {array.shape}")
    if not 0 < white < np.inf:
        raise ValueError(f"Expected a white level above 0, got {white!r}; set white=255")
    if array.dtype.kind == "f" and array.size:
        _check_grey_levels(array, white)
        array = array if white == WHITE else array * array.dtype.type(WHITE / white)
    return array


def _check_grey_levels(array: NDArray[Any], white: float) -> None:
    low, high = float(array.min()), float(array.max())
    if not (low >= 0 and high <= white):  # written so that NaN fails too
        raise ValueError(
            f"Expected finite grey levels from 0 to {white:g}, got {low} to {high}; "
            "clip the frames and replace NaN before simulating, or set white"
        )


def checked_times(timestamps_us: Any, count: int) -> NDArray[np.int64]:  # noqa: ANN401
    """Return `count` strictly increasing times as int64 microseconds.

    Raises:
        ValueError: they are not whole numbers, not `count` of them, or do not increase.

    Example:
        >>> checked_times([0, 50_000], count=2).tolist()
        [0, 50000]
    """
    times = np.asarray(timestamps_us)
    if times.size == 0:
        times = times.astype(np.int64)
    if times.dtype.kind not in "iu":
        raise ValueError(
            f"Expected frame times in whole microseconds, got {times.dtype}; "
            "convert seconds with (seconds * 1e6).astype(int)"
        )
    if times.shape != (count,):
        raise ValueError(
            f"Expected one time for each of the {count} frames, got times shaped {times.shape}"
        )
    if times.dtype == np.uint64 and count and int(times.max()) > np.iinfo(np.int64).max:
        raise ValueError(f"Expected frame times that fit int64, got {times.max()}")
    times = times.astype(np.int64)
    back = np.flatnonzero(np.diff(times) <= 0)
    if len(back):
        at = int(back[0]) + 1
        otherwise = "sort the frames by time and drop repeated ones"
        advice = backwards(int(times[at - 1]), int(times[at]), otherwise)
        raise ValueError(
            f"Expected frame times that increase, got {times[at]} us after {times[at - 1]} us at "
            f"frame {at}; {advice}"
        )
    return times
