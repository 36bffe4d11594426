"""What a mAP counts: classes, field of view, smallest size and score, named and stored."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.data.matching import MatchedLabels, match_labels


@dataclass(frozen=True, kw_only=True)
class LabelProtocol:
    """The population of boxes that training and evaluation share, and how detections enter.

    Numbers measured with different protocols cannot be compared, so `card()` is stored beside
    every number.

    Convention: a box covers the pixels from its left edge x to x + w, edges included in neither
    neighbour; it is clipped to [0, width] x [0, rows] first and measured afterwards. Limits are
    inclusive. (The published detector's program clips to width - 1 instead, one pixel less.)

    Args:
        name: name of the protocol.
        classes: data set ids of each class, in label order; other ids are left out.
        min_side_px: smallest width and height.
        min_diagonal_px: smallest diagonal.
        reference_width: sensor width for which the sizes are meant; other sensors scale them.
            None takes them as they are.
        crop_rows: number of rows, counted from the top, that are used; all of them if None.
        score_empty_frames: whether a frame without a box counts, as one that shows no object; if
            not, it drops out together with its detections.
        filter_detections: whether detections below the size limits drop out as labels do.
        label_tolerance_us: largest distance between a label and the frame it belongs to; more is
            another time, since things move.
        least_matched_labels: share of a recording's label times that must belong to a frame.
        class_score: whether detections are ranked by their class confidence alone, instead of its
            product with the objectness.

    Raises:
        ValueError: there is no class, an id belongs to two classes, or a size is negative.

    Example:
        >>> protocol = LabelProtocol(name="cars", classes={"car": [2, 3]}, min_side_px=5)
        >>> rows = np.array([(30, 2, 40, 9, 3)],
        ...                 dtype=[(name, float) for name in ("x", "y", "w", "h", "class_id")])
        >>> boxes, labels = protocol.select(rows, height=48, width=64)
        >>> boxes.tolist(), labels.tolist()
        ([[30.0, 2.0, 64.0, 11.0]], [0])
    """

    name: str
    classes: Mapping[str, Sequence[int]]
    min_side_px: float = 0.0
    min_diagonal_px: float = 0.0
    reference_width: int | None = None
    crop_rows: int | None = None
    score_empty_frames: bool = True
    filter_detections: bool = False
    class_score: bool = False
    label_tolerance_us: int = 5_000
    least_matched_labels: float = 0.9

    def __post_init__(self) -> None:
        """Check the classes and sizes, and keep plain copies of configured containers."""
        plain = {str(name): tuple(int(each) for each in ids) for name, ids in self.classes.items()}
        object.__setattr__(self, "classes", plain)
        ids = [number for numbers in self.classes.values() for number in numbers]
        if not self.classes or len(set(ids)) != len(ids):
            raise ValueError(
                f"Expected classes that share no data set id, got {dict(self.classes)}; "
                "set protocol.classes"
            )
        if self.label_tolerance_us < 0 or not 0 <= self.least_matched_labels <= 1:
            raise ValueError(
                f"Expected a tolerance of zero or more and a share in [0, 1], got "
                f"{self.label_tolerance_us} and {self.least_matched_labels}; set "
                "protocol.label_tolerance_us and protocol.least_matched_labels"
            )
        if min(self.min_side_px, self.min_diagonal_px) < 0:
            raise ValueError(
                f"Expected sizes of zero or more, got {self.min_side_px} and "
                f"{self.min_diagonal_px}; set protocol.min_side_px and protocol.min_diagonal_px"
            )

    def require_known(self, classes: Mapping[str, Sequence[int]] | None) -> None:
        """See that the classes are those of the data set, where it names its own.

        Raises:
            ValueError: one of the numbers that count is no class of the data set.
        """
        if not classes:
            return
        known = {int(number) for numbers in classes.values() for number in numbers}
        if not known.issuperset(self._label_of):
            named = {name: [*numbers] for name, numbers in classes.items()}
            raise ValueError(
                f"Expected a protocol of the data set's classes {named}, got {self.name} with "
                f"{ {name: [*each] for name, each in self.classes.items()} }; set protocol=own"
            )

    def match(
        self, tracks: NDArray[Any] | None, frame_times_us: NDArray[np.int64]
    ) -> MatchedLabels:
        """The label rows of each frame; none where nothing was labelled."""
        if tracks is None:
            tracks = np.empty(
                0, [(name, np.int64) for name in ("t", "x", "y", "w", "h", "class_id")]
            )
        return match_labels(tracks, frame_times_us, self.label_tolerance_us)

    @property
    def class_names(self) -> tuple[str, ...]:
        """Names of the classes in label order."""
        return tuple(self.classes)

    def rows(self, height: int) -> int:
        """Rows that are used of a sensor with `height` of them."""
        return min(self.crop_rows or height, height)

    def select(
        self, tracks: NDArray[Any], height: int, width: int
    ) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """The boxes of one frame that count.

        Args:
            tracks: label rows with the fields x, y, w, h (top left corner and size in pixels)
                and class_id.
            height: rows of the sensor, before any crop.
            width: columns of the sensor.

        Returns:
            Boxes as x1 y1 x2 y2 in pixels, float32, shape (n, 4), and their classes, int64, (n,).
        """
        labels = self._labels(tracks["class_id"])
        left, top = (tracks[name].astype(np.float32) for name in "xy")
        right, bottom = (
            tracks[corner].astype(np.float32) + tracks[side].astype(np.float32)
            for corner, side in ("xw", "yh")
        )
        boxes = np.stack([left, top, right, bottom], axis=1)
        boxes = clip_boxes(boxes, self.rows(height), width)
        keep = (labels >= 0) & np.all(boxes[:, 2:] > boxes[:, :2], axis=1)
        keep &= self.large_enough(boxes, width)
        return boxes[keep], labels[keep]

    def large_enough(self, boxes: NDArray[np.float32], width: int) -> NDArray[np.bool_]:
        """Which boxes x1 y1 x2 y2, shape (n, 4), reach the size limits on a sensor this wide."""
        sides = boxes[:, 2:] - boxes[:, :2]
        scale = 1.0 if self.reference_width is None else width / self.reference_width
        large = np.all(sides >= self.min_side_px * scale, axis=1)
        enough: NDArray[np.bool_] = large & (np.hypot(*sides.T) >= self.min_diagonal_px * scale)
        return enough

    def card(self) -> dict[str, Any]:
        """Everything that decides which boxes count, for storing beside a number."""
        return {
            "name": self.name,
            "classes": {name: list(ids) for name, ids in self.classes.items()},
            "min_side_px": self.min_side_px,
            "min_diagonal_px": self.min_diagonal_px,
            "reference_width": self.reference_width,
            "crop_rows": self.crop_rows,
            "score_empty_frames": self.score_empty_frames,
            "filter_detections": self.filter_detections,
            "class_score": self.class_score,
            "label_tolerance_us": self.label_tolerance_us,
        }

    @cached_property
    def _label_of(self) -> dict[int, int]:
        return {number: label for label, ids in enumerate(self.classes.values()) for number in ids}

    def _labels(self, ids: NDArray[Any]) -> NDArray[np.int64]:
        """Class of each row, -1 for the ids that are left out."""
        return np.array([self._label_of.get(number, -1) for number in ids.tolist()], np.int64)


def clip_boxes(boxes: NDArray[np.float32], height: int, width: int) -> NDArray[np.float32]:
    """Boxes x1 y1 x2 y2 with their edges moved into the frame; those outside become flat."""
    limits = np.array([width, height, width, height], np.float32)
    return np.clip(boxes, np.float32(0), limits)


def detector_rows(boxes: NDArray[np.float32], labels: NDArray[np.int64]) -> NDArray[np.float32]:
    """The detector's label rows (class, centre x, centre y, width, height), shape (n, 5)."""
    rows = np.empty((len(boxes), 5), np.float32)
    rows[:, 0] = labels
    rows[:, 1:3] = (boxes[:, :2] + boxes[:, 2:]) / 2
    rows[:, 3:5] = boxes[:, 2:] - boxes[:, :2]
    return rows
