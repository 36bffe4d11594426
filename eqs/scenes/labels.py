"""Boxes of the rendered world in the layout of DSEC-Detection."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from eqs.scenes.world import ActorsInView

# The published fields, then how much of the outline can be seen; readers go by name.
TRACK_DTYPE: Final = np.dtype(
    [
        ("t", "<u8"),
        ("x", "<f4"),
        ("y", "<f4"),
        ("w", "<f4"),
        ("h", "<f4"),
        ("class_id", "u1"),
        ("class_confidence", "<f4"),
        ("track_id", "<u4"),
        ("visibility", "<f4"),
    ]
)


@dataclass(frozen=True, kw_only=True)
class LabelRule:
    """Which actors in sight get a box; the default width is five columns of a 128x96 image.

    Args:
        smallest_width: least width of a clipped box, as a share of the image's.
        smallest_height: least height of a clipped box, as a share of the image's.
        least_visible: least share of the outline inside the image that nothing hides.
        least_inside: least share of the box that lies inside the image.
    """

    smallest_width: float = 25 / 640
    smallest_height: float = 20 / 480
    least_visible: float = 0.5
    least_inside: float = 0.15

    def boxes(self, view: ActorsInView, t_us: int) -> NDArray[np.void]:
        """Rows of `TRACK_DTYPE` for one instant, boxes clipped to the image."""
        height, width = view.owner.shape
        limits = np.array([width, height, width, height], np.float64)
        clipped = np.clip(view.boxes, 0.0, limits)
        size = clipped[:, 2:] - clipped[:, :2]
        whole = np.maximum(view.boxes[:, 2:] - view.boxes[:, :2], 1e-9)
        keep = (size[:, 0] >= self.smallest_width * width) & (view.visible >= self.least_visible)
        keep &= size[:, 1] >= self.smallest_height * height
        keep &= size.prod(1) / whole.prod(1) >= self.least_inside
        rows = np.zeros(int(keep.sum()), TRACK_DTYPE)
        rows["t"] = t_us
        rows["x"], rows["y"] = clipped[keep, 0], clipped[keep, 1]
        rows["w"], rows["h"] = size[keep, 0], size[keep, 1]
        rows["class_id"], rows["track_id"] = view.labels[keep], view.tracks[keep]
        rows["class_confidence"], rows["visibility"] = 1.0, view.visible[keep]
        return rows
