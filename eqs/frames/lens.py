"""What a lens does to a flat image: it darkens the corners, blurs, and bends straight lines."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from eqs.frames.luma import GreyImage

_BLUR_REACH = 3.0  # standard deviations after which a blur is cut off


@dataclass(frozen=True, kw_only=True)
class Lens:
    """A thin lens in front of a flat image: the same at all depths, and still.

    It acts on what the simulator sees, light or display values; only of light is it a lens. Defocus
    that depends on depth, ghosts and chromatic aberration need a scene. Vignetting is one factor
    per pixel, which a logarithmic pixel without dark current does not see.

    Convention: the pixel at a distance r from the middle, in focal lengths, sees the ideal image at
    `r (1 + distortion_k1 r^2)`; beyond its edge the ideal image goes on as at the edge.

    Args:
        vignetting: 0 for none, 1 for the fourth power of the cosine.
        field_of_view_deg: from the left edge to the right one.
        blur_px: standard deviation of a Gaussian blur.
        distortion_k1: above 0 the image is drawn together (barrel), below it is pulled out.

    Raises:
        ValueError: a value is out of its range.

    Example:
        >>> flat = GreyImage.from_frame(np.full((1, 3), 100.0))
        >>> dim = Lens(vignetting=1.0, field_of_view_deg=90.0).seen(flat)
        >>> dim.levels[dim.codes].round(1).tolist()
        [47.9, 100.0, 47.9]
    """

    vignetting: float = 1.0
    field_of_view_deg: float = 60.0
    blur_px: float = 0.5
    distortion_k1: float = 0.0

    def __post_init__(self) -> None:
        """Check the values."""
        for name, fits, range_ in (
            ("vignetting", 0 <= self.vignetting <= 1, "from 0 to 1"),
            ("field_of_view_deg", 0 < self.field_of_view_deg < 180, "between 0 and 180"),
            ("blur_px", 0 <= self.blur_px < math.inf, "of 0 or more"),
            ("distortion_k1", abs(self.distortion_k1) <= 1, "from -1 to 1"),
        ):
            if not fits:
                raise ValueError(
                    f"Expected {name} {range_}, got {getattr(self, name)!r}; set lens.{name}"
                )

    def parameters(self) -> dict[str, Any]:
        """What changes the events."""
        return asdict(self)

    def seen(self, image: GreyImage) -> GreyImage:
        """The image behind the lens."""
        seen = image.levels[image.codes].reshape(image.height, image.width)
        if self.distortion_k1 != 0:
            places = _bent(image.height, image.width, self.field_of_view_deg, self.distortion_k1)
            seen = ndimage.map_coordinates(seen, places, order=1, mode="nearest")
        if self.blur_px > 0:
            seen = ndimage.gaussian_filter(seen, self.blur_px, mode="nearest", truncate=_BLUR_REACH)
        if self.vignetting > 0:
            cosine = _cosine_to_the_fourth(image.height, image.width, self.field_of_view_deg)
            seen = seen * (1 + self.vignetting * (cosine - 1))
        return GreyImage.from_frame(np.asarray(seen))


def _offsets(height: int, width: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How far each row and column lies from the middle, in pixels."""
    return np.arange(float(height)) - (height - 1) / 2, np.arange(float(width)) - (width - 1) / 2


def _focal_px(width: int, field_of_view_deg: float) -> float:
    return 0.5 * width / math.tan(math.radians(field_of_view_deg) / 2)


@lru_cache(maxsize=4)
def _cosine_to_the_fourth(height: int, width: int, field_deg: float) -> NDArray[np.float64]:
    rows, columns = _offsets(height, width)
    tangents = np.hypot(rows[:, None], columns) / _focal_px(width, field_deg)
    falloff: NDArray[np.float64] = (1 + tangents**2) ** -2.0
    return falloff


@lru_cache(maxsize=4)
def _bent(height: int, width: int, field_deg: float, k1: float) -> NDArray[np.float64]:
    """Row and column at which each pixel sees the ideal image."""
    rows, columns = _offsets(height, width)
    radii = np.hypot(rows[:, None], columns) / _focal_px(width, field_deg)
    stretch = 1 + k1 * radii**2
    return np.stack(
        [rows[:, None] * stretch + (height - 1) / 2, columns * stretch + (width - 1) / 2]
    )
