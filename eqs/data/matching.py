"""Which frame a label belongs to, where the times of both differ by a rounding."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True, eq=False)
class MatchedLabels:
    """The labels of a recording, dealt to its frames.

    Args:
        rows: label rows that belong to a frame, by rising frame.
        frames: index of the frame of each row, int64.
        label_times: number of different label times.
        matched: how many of them belong to a frame.
        farthest_us: the largest distance between one of those and its frame.
        doubtful: frames beside a label time that belongs to none: what they show is not known.
    """

    rows: NDArray[Any]
    frames: NDArray[np.int64]
    label_times: int
    matched: int
    farthest_us: int
    doubtful: frozenset[int]

    @property
    def share(self) -> float:
        """Share of the label times that belong to a frame; 1 without labels."""
        return self.matched / self.label_times if self.label_times else 1.0

    def at(self, frame: int) -> NDArray[Any]:
        """The label rows of one frame."""
        first, last = np.searchsorted(self.frames, [frame, frame + 1])
        return self.rows[first:last]


def match_labels(
    tracks: NDArray[Any], frame_times_us: NDArray[np.int64], tolerance_us: int
) -> MatchedLabels:
    """Deal labels to the frames they were made for.

    Convention: a label belongs to the nearest frame, if that is within the tolerance. Of several
    label times near one frame the nearest counts, the earlier of two as near, and the others belong
    to none: two looks at a scene are not one.

    Args:
        tracks: label rows with a field `t`, whole microseconds.
        frame_times_us: time of each frame, rising.
        tolerance_us: largest distance between a label and its frame.

    Example:
        >>> tracks = np.array([(99,), (151,), (240,)], dtype=[("t", np.int64)])
        >>> found = match_labels(tracks, np.array([50, 100, 150, 200]), tolerance_us=5)
        >>> found.frames.tolist(), found.matched, found.label_times, sorted(found.doubtful)
        ([1, 2], 2, 3, [3])
    """
    times, belongs = np.unique(tracks["t"].astype(np.int64), return_inverse=True)
    if not len(times) or not len(frame_times_us):
        return _no_labels(tracks, len(times))
    after = np.searchsorted(frame_times_us, times).clip(1, max(1, len(frame_times_us) - 1))
    near = np.stack([after - 1, np.minimum(after, len(frame_times_us) - 1)])
    distances = np.abs(frame_times_us[near] - times)
    nearest = near[distances.argmin(0), np.arange(len(times))]
    distance = distances.min(0)
    # The nearest label time of each frame comes first; the order is stable, so the earlier wins.
    order = np.lexsort((times, distance, nearest))
    first = np.r_[True, np.diff(nearest[order]) > 0]
    kept = np.zeros(len(times), np.bool_)
    kept[order[first]] = True
    kept &= distance <= tolerance_us
    rows = np.flatnonzero(kept[belongs])
    frames = nearest[belongs[rows]]
    order = np.argsort(frames, kind="stable")
    return MatchedLabels(
        rows=tracks[rows[order]],
        frames=frames[order].astype(np.int64),
        label_times=len(times),
        matched=int(kept.sum()),
        farthest_us=int(distance[kept].max()) if kept.any() else 0,
        doubtful=frozenset(nearest[~kept].tolist()) - frozenset(nearest[kept].tolist()),
    )


def _no_labels(tracks: NDArray[Any], times: int) -> MatchedLabels:
    return MatchedLabels(
        rows=tracks[:0],
        frames=np.empty(0, np.int64),
        label_times=times,
        matched=0,
        farthest_us=0,
        doubtful=frozenset(),
    )
