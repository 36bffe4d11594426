"""Baselines that compare events as points in space, time and polarity.

Source: Han et al., "Physical-Based Event Camera Simulator", ECCV 2024: x, y and polarity scaled to
[0, 100], time to [0, 1000], nearest neighbours taken both ways.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from eqs.events import Events

POINTS = 1000  # per window and stream; distances depend on their number, so it is fixed
EXTENT = np.array([1000.0, 100.0, 100.0, 100.0])
FARTHEST = float(np.linalg.norm(EXTENT))


def point_baselines(
    simulated: Events, real: Events, *, start_us: int, window_us: int, windows: int
) -> dict[str, float]:
    """Mean distance to the nearest event of the other stream, both ways, window by window.

    `chamfer_distance` is the mean of the distance d, `gaussian_distance` that of
    `1 - exp(-d^2 / 0.4)`, where only close neighbours count.

    Convention: events are drawn at random where a window holds more than `POINTS`; a silent
    window beside another is as far as the scaled volume is long, two silent ones are equal.
    """
    found = nearest_distances(simulated, real, start_us, window_us, windows)
    chamfer = [0.5 * (there.mean() + back.mean()) for there, back in found]
    close = [tuple(1.0 - np.exp(-(d**2) / 0.4) for d in pair) for pair in found]
    gaussian = [0.5 * (there.mean() + back.mean()) for there, back in close]
    return {
        "chamfer_distance": float(np.mean(chamfer)),
        "gaussian_distance": float(np.mean(gaussian)),
    }


def nearest_distances(
    first: Events, second: Events, start_us: int, window_us: int, windows: int
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Distances to the nearest neighbour, from first to second and back, for every window."""
    pairs = []
    for start in (start_us + window_us * np.arange(windows)).tolist():
        a, b = (points(each, start, window_us) for each in (first, second))
        if len(a) and len(b):
            pairs.append((_nearest(a, b), _nearest(b, a)))
        else:
            apart = np.array([0.0 if len(a) == len(b) else FARTHEST])
            pairs.append((apart, apart))
    return pairs


def _nearest(these: NDArray[np.float64], those: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(cKDTree(those).query(these)[0])


def points(events: Events, start_us: int, window_us: int) -> NDArray[np.float64]:
    """Events of one window as scaled points (n, 4): time, x, y, polarity.

    The draw depends on the number of events alone, so that equal streams lend equal points.
    """
    inside = events.window(start_us, start_us + window_us)
    kept = np.arange(len(inside))
    if len(kept) > POINTS:
        kept = np.random.default_rng(0).choice(kept, POINTS, replace=False)
    scaled = (
        (inside.t[kept] - start_us) / window_us,
        inside.x[kept] / max(events.width - 1, 1),
        inside.y[kept] / max(events.height - 1, 1),
        inside.p[kept].astype(np.float64),
    )
    stacked: NDArray[np.float64] = np.stack(scaled, axis=1) * EXTENT
    return stacked
