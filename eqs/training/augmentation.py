"""Random mirroring and zooming of a run of windows and its boxes."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from eqs.data.labels import clip_boxes

SMALLEST_SIDE_PX = 1.0  # what a zoom leaves of a box must be at least a pixel wide and high


@dataclass(frozen=True, kw_only=True)
class View:
    """One mirroring and one zoom, the same for all windows of a sample.

    Zooming in shows a part of `rows` by `columns` pixels, whose top left corner is (x, y), at the
    size of the whole frame. Zooming out shows the whole frame in such a part, empty around it.

    Convention: boxes move with the edges of pixels, so the mirror of x is width - x. (The published
    detector's program mirrors to width - 1 - x, and scales zoomed boxes by the drawn factor where
    the picture is scaled by a ratio of whole pixels.)
    """

    flip: bool = False
    inwards: bool = False
    x: int = 0
    y: int = 0
    rows: int
    columns: int

    def picture(self, frames: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Frames (..., height, width) as they appear in this view; nearest pixels, no blending."""
        height, width = frames.shape[-2:]
        if self.flip:
            frames = frames[..., ::-1]
        if (self.rows, self.columns) == (height, width):
            return np.ascontiguousarray(frames)
        part = (..., slice(self.y, self.y + self.rows), slice(self.x, self.x + self.columns))
        if self.inwards:
            return _resized(frames[part], height, width)
        out = np.zeros_like(frames)
        out[part] = _resized(frames, self.rows, self.columns)
        return out

    def boxes(self, boxes: NDArray[np.float32], height: int, width: int) -> NDArray[np.float32]:
        """Boxes x1 y1 x2 y2 in this view, clipped to the frame; those left outside become flat."""
        if self.flip:
            boxes = np.stack(
                [width - boxes[:, 2], boxes[:, 1], width - boxes[:, 0], boxes[:, 3]], axis=1
            )
        corner = np.array([self.x, self.y] * 2, np.float32)
        ratio = np.array([self.columns / width, self.rows / height] * 2, np.float32)
        moved = (boxes - corner) / ratio if self.inwards else boxes * ratio + corner
        return clip_boxes(moved, height, width)


@dataclass(frozen=True, kw_only=True)
class Augmentation:
    """How often and how far a sample is mirrored and zoomed.

    Random samples zoom in, to a part that shows one box whole, or out. Stream samples only zoom
    out: a part chosen for one box would not suit a whole recording.

    Args:
        flip_probability: of mirroring left and right.
        zoom_probability: of zooming a random sample.
        zoom_in_share: of the zooms of random samples, those that zoom in.
        stream_zoom_probability: of zooming a stream sample out.
        most_zoom_in: largest factor, drawn uniformly from 1.
        most_zoom_out: largest factor, drawn uniformly from 1.

    Raises:
        ValueError: a probability or share lies outside 0 to 1, or a factor below 1.

    Source: Gehrig and Scaramuzza, CVPR 2023, released configuration.
    """

    flip_probability: float = 0.5
    zoom_probability: float = 0.8
    zoom_in_share: float = 0.8
    stream_zoom_probability: float = 0.5
    most_zoom_in: float = 1.5
    most_zoom_out: float = 1.2

    def __post_init__(self) -> None:
        """Check the ranges."""
        for field in fields(self):
            value = getattr(self, field.name)
            low, high = (1.0, np.inf) if field.name.startswith("most_") else (0.0, 1.0)
            if not low <= value <= high:
                raise ValueError(
                    f"Expected {field.name} from {low:g} to {high:g}, got {value}; "
                    f"set datamodule.augmentation.{field.name}"
                )

    def draw(
        self,
        generator: np.random.Generator,
        boxes: NDArray[np.float32],
        height: int,
        width: int,
        *,
        stream: bool,
    ) -> View:
        """One view, for frames of this size.

        Args:
            generator: where the draws come from.
            boxes: boxes x1 y1 x2 y2 of the sample's last labelled frame, shape (n, 4).
            height: rows of the frames.
            width: columns of the frames.
            stream: whether the sample belongs to a stream slot.
        """
        # Every draw is taken whether it is used or not, so that none depends on another's outcome.
        flip, zoom, direction, factor, pick, across, down = generator.random(7)
        flipped = bool(flip < self.flip_probability)
        if zoom >= (self.stream_zoom_probability if stream else self.zoom_probability):
            return View(flip=flipped, rows=height, columns=width)
        inwards = not stream and bool(direction < self.zoom_in_share)
        most = self.most_zoom_in if inwards else self.most_zoom_out
        size = 1 + (most - 1) * factor
        rows, columns = int(height / size), int(width / size)
        low, high = (0, 0), (width - columns, height - rows)
        if inwards and len(boxes):
            shown = boxes[int(pick * len(boxes))]
            if flipped:
                shown = View(flip=True, rows=height, columns=width).boxes(
                    shown[None], height, width
                )[0]
            low, high = _corners_showing(shown, (columns, rows), high)
        x, y = (
            first + int(draw * (last - first + 1))
            for first, last, draw in zip(low, high, (across, down), strict=True)
        )
        return View(flip=flipped, inwards=inwards, x=x, y=y, rows=rows, columns=columns)


def visible(boxes: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Which boxes are still a pixel wide and high, shape (n,)."""
    wide: NDArray[np.bool_] = np.all(boxes[:, 2:] - boxes[:, :2] >= SMALLEST_SIDE_PX, axis=1)
    return wide


def _corners_showing(
    box: NDArray[np.float32], part: tuple[int, int], limit: tuple[int, int]
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Smallest and largest corner (x, y) of a part (columns, rows) that shows a box whole.

    A box larger than the part is shown from its own corner on, or as far as the frame allows.
    """
    low, high = [], []
    for start, stop, length, last in zip(box[:2], box[2:], part, limit, strict=True):
        first = min(max(int(np.ceil(stop)) - length, 0), last)
        low.append(first)
        high.append(max(first, min(int(start), last)))
    return (low[0], low[1]), (high[0], high[1])


def _resized(frames: NDArray[np.uint8], height: int, width: int) -> NDArray[np.uint8]:
    """Frames at another size, each pixel taken from the source pixel under its centre."""
    rows, columns = (
        (2 * np.arange(wanted) + 1) * given // (2 * wanted)
        for wanted, given in zip((height, width), frames.shape[-2:], strict=True)
    )
    resized: NDArray[np.uint8] = frames.take(rows, axis=-2).take(columns, axis=-1)
    return resized
