"""How a part of an actor is written down: columns that compiled code reads.

A part is a frustum (one rectangle below, one above, and everything between), an upright wheel or
a blob that faces the camera. Rectangles are `(right, forward, half width, half length, up)` in
metres in the actor's own frame; discs are `(right, forward, radius, ring width, up)`, a ring
width of zero for a full disc. Parts are painted in order.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from eqs.scenes.substances import Substance

Rectangle = tuple[float, float, float, float, float]

# Columns of an actor row.
X, Z, SPEED, HEADING, DEPTH_SORT, LABEL = range(6)
ACTOR_COLUMNS: Final = 6

# Columns of a part row: two rectangles of five numbers come first.
LOW, HIGH = 0, 5
SHAPE, MODE, SEEN_FROM, ALBEDO, PANE, EMIT, SWING, RATE, PHASE, LIFT, SUBSTANCE = range(10, 21)
PART_COLUMNS: Final = 21

FRUSTUM, WHEEL, BLOB = range(3)
SOLID, ATOP, SHADOW = range(3)  # how a part joins the actor's picture
ANY, FRONT, BACK, RIGHT, LEFT = range(5)  # from where a part is seen
PLAIN = -1.0  # a pane albedo: the part has no shaded faces, only an outline


def part(
    low: Rectangle,
    high: Rectangle = (0.0, 0.0, 0.0, 0.0, 0.0),
    albedo: float = 0.0,
    *,
    shape: int = FRUSTUM,
    mode: int = SOLID,
    seen_from: int = ANY,
    pane: float = PLAIN,
    emit: float = 0.0,
    swing: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
    of: Substance = Substance.METAL,
) -> tuple[float, ...]:
    """One part row; `swing` is amplitude (m), rate (rad/s), phase and lift (m) of its low end."""
    return (*low, *high, shape, mode, seen_from, albedo, pane, emit, *swing, of)


def part_rows(parts: list[tuple[float, ...]]) -> NDArray[np.float64]:
    """Parts as one array, shape (n, PART_COLUMNS)."""
    return np.array(parts, dtype=np.float64).reshape(-1, PART_COLUMNS)
