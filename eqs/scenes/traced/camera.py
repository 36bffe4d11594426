"""The traced camera: a thin lens before a film that sees as the quantum efficiency says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from eqs.frames import QUANTUM_EFFICIENCY
from eqs.scenes.optics import CAM_COS, CAM_PITCH, CAM_ROLL, CAM_SIN, CAM_X, CAM_Y, CAM_Z
from eqs.scenes.traced.materials import Plugin, spectrum
from eqs.scenes.traced.surroundings import mirrored
from eqs.scenes.world import FIELD_OF_VIEW_RAD

# What the film adds up over wavelengths, as a mean over the bands of the efficiency.
PER_INTEGRAL: Final = float(
    np.mean(QUANTUM_EFFICIENCY) / np.trapezoid(QUANTUM_EFFICIENCY, np.linspace(400.0, 700.0, 31))
)


@dataclass(frozen=True, kw_only=True)
class Lens:
    """A thin lens, which blurs what is not in focus and knows no other error.

    Args:
        aperture_radius_m: half the width of its opening; 0 for a pinhole, to which all is sharp.
        focus_distance_m: depth that is sharp.

    Raises:
        ValueError: the radius is negative, or the distance not above zero.

    Example:
        >>> round(Lens(aperture_radius_m=0.01, focus_distance_m=4.0).blur_px(8.0, 158.4), 3)
        0.396
    """

    aperture_radius_m: float = 0.003
    focus_distance_m: float = 15.0

    def __post_init__(self) -> None:
        """Check the lengths."""
        if not (self.aperture_radius_m >= 0.0 and self.focus_distance_m > 0.0):
            raise ValueError(
                "Expected an aperture radius of 0 or more and a focus distance above 0, got "
                f"{self.aperture_radius_m} and {self.focus_distance_m}; set "
                "lens.aperture_radius_m and lens.focus_distance_m"
            )

    def blur_px(self, depth_m: float, focal_px: float) -> float:
        """Width in pixels of the disc that a point at a depth becomes."""
        away = abs(1.0 / self.focus_distance_m - 1.0 / depth_m)
        return 2.0 * self.aperture_radius_m * focal_px * away


def camera_plugin(height: int, width: int, lens: Lens, samples_per_pixel: int) -> Plugin:
    """The camera at the origin, looking along the street.

    Samples fall into the pixel they lie in alone, so that one seed gives what rests the same noise
    in every frame; they are spread evenly, which takes half of the noise of independent ones.
    """
    blurred = lens.aperture_radius_m > 0.0
    opening = {
        "aperture_radius": lens.aperture_radius_m, "focus_distance": lens.focus_distance_m
    } if blurred else {}  # fmt: skip
    return {
        "type": "thinlens" if blurred else "perspective",
        "fov": float(np.rad2deg(FIELD_OF_VIEW_RAD)),
        "fov_axis": "x",
        **opening,
        "sampler": {"type": "multijitter", "sample_count": samples_per_pixel},
        "film": {
            "type": "specfilm",
            "width": width,
            "height": height,
            "component_format": "float32",
            "rfilter": {"type": "box"},
            "current": spectrum(np.array(QUANTUM_EFFICIENCY)),
        },
    }


def developed(film: NDArray[np.float32]) -> NDArray[np.float32]:
    """Photocurrents (H, W) of what the film gives: a flat spectrum at L is L times mean(eta)."""
    current: NDArray[np.float32] = film[..., 0] * np.float32(PER_INTEGRAL)
    return current


def pose(camera: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where a camera vector's camera stands and looks, as a matrix of the tracer's, (4, 4).

    Its columns are left, up, ahead and the place. The painter shears the image by pitch and roll;
    both are turned here, which differs by less than half a pixel at the edges.
    """
    ahead = np.array([camera[CAM_SIN], 0.0, camera[CAM_COS]])
    right = np.array([camera[CAM_COS], 0.0, -camera[CAM_SIN]])
    up = np.array([0.0, 1.0, 0.0])
    pitch, roll = camera[CAM_PITCH], camera[CAM_ROLL]
    ahead, up = (
        np.cos(pitch) * ahead + np.sin(pitch) * up,
        np.cos(pitch) * up - np.sin(pitch) * ahead,
    )
    right, up = (
        np.cos(roll) * right + np.sin(roll) * up,
        np.cos(roll) * up - np.sin(roll) * right,
    )
    place = camera[[CAM_X, CAM_Y, CAM_Z]]
    matrix = np.eye(4)
    matrix[:3] = mirrored(np.stack([-right, up, ahead, place])).T
    return matrix
