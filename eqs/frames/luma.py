"""From camera frames to grey levels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

GREY_LEVELS = np.arange(256, dtype=np.float64)
BT601 = (0.299, 0.587, 0.114)


def luma(frames: NDArray[Any], rounded: bool = True) -> NDArray[Any]:
    """BT.601 luma `0.299 R + 0.587 G + 0.114 B` of colour frames.

    Args:
        frames: red, green and blue along the last axis, uint8 or floating, 0..255.
        rounded: give 8-bit frames 8-bit luma, halves rounded up; float luma otherwise. Floating
            frames always keep their fractions.

    Returns:
        Frames without the last axis: uint8 where rounded, else float64.

    Example:
        >>> luma(np.uint8([[[10, 20, 30], [255, 255, 255]]])).tolist()
        [[18, 255]]
    """
    red, green, blue = (frames[..., channel] for channel in range(3))
    if frames.dtype == np.uint8 and rounded:
        total = 299 * red.astype(np.uint32) + 587 * green.astype(np.uint32)
        return ((total + 114 * blue.astype(np.uint32) + 500) // 1000).astype(np.uint8)
    return BT601[0] * red.astype(np.float64) + BT601[1] * green + BT601[2] * blue


@dataclass(frozen=True, slots=True, eq=False)
class GreyImage:
    """A grey image as indices into a table of grey levels.

    An 8-bit image shares one table of 256 levels, so a function of the grey level is evaluated
    256 times instead of once per pixel; a floating image is its own table. Code that reads
    `function(image.levels)[image.codes]` serves both and gives equal results for equal values.

    Args:
        codes: index into `levels` for each pixel, row by row, shape (height * width,).
        levels: grey levels, 0..255, float64.
        height: rows.
        width: columns.
        first_pixel: number of the first pixel on the sensor, where the image is a part of it.
    """

    codes: NDArray[Any]
    levels: NDArray[np.float64]
    height: int
    width: int
    first_pixel: int = 0

    @classmethod
    def from_frame(cls, frame: NDArray[Any], rounded_luma: bool = True) -> GreyImage:
        """Take a checked frame, grey `(H, W)` or colour `(H, W, 3)`; the pixels are copied.

        Example:
            >>> image = GreyImage.from_frame(np.float32([[0, 2.5]]))
            >>> image.levels[image.codes].tolist()
            [0.0, 2.5]
        """
        grey = luma(frame, rounded_luma) if frame.ndim == 3 else frame
        height, width = grey.shape
        if grey.dtype == np.uint8:
            return cls(grey.flatten(), GREY_LEVELS, height, width)
        codes = np.arange(grey.size, dtype=np.int32)
        return cls(codes, grey.astype(np.float64).ravel(), height, width)

    def bands(self, count: int) -> list[GreyImage]:
        """The image cut into at most `count` bands of about equal height.

        Example:
            >>> image = GreyImage.from_frame(np.zeros((5, 4), np.uint8))
            >>> [(band.height, band.first_pixel) for band in image.bands(2)]
            [(3, 0), (2, 12)]
        """
        rows = -(-self.height // count)
        return [
            self._rows(top, min(top + rows, self.height)) for top in range(0, self.height, rows)
        ]

    def _rows(self, top: int, bottom: int) -> GreyImage:
        part = slice(top * self.width, bottom * self.width)
        codes, levels = self.codes[part], self.levels
        if codes.dtype != np.uint8:  # a floating image is its own table
            codes, levels = self.codes[: codes.size], levels[part]
        return GreyImage(codes, levels, bottom - top, self.width, self.first_pixel + part.start)
