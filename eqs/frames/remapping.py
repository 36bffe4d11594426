"""Frames of one camera as another camera in nearly the same place sees them.

Source: the pinhole camera with radial and tangential distortion (Brown 1966), and the homography
of the plane at infinity, H = K R K^-1 (Hartley and Zisserman, Multiple View Geometry, 13.4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

UNDISTORTED = 1e-12  # change of a ray at which the search for it ends
MOST_STEPS = 100
FAR = 10.0  # a ray that moves so far at once never arrives
BAND = 32  # rows whose weights are gathered at once


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """How the pixels of an event camera look into the image of a frame camera.

    Convention: pixel (0, 0) has its centre at (0, 0). Everything is taken to be infinitely far
    away: a point at Z metres is seen `focal length * baseline / Z` pixels beside.

    Args:
        matrix: focal lengths and centre fx, fy, cx, cy of the event camera, pixels.
        distortion: k1, k2, p1, p2 of the event camera.
        size: height and width of the event camera.
        rotation: 3x3, turns rays of the event camera into those of the frame camera.
        frame_matrix: fx, fy, cx, cy of the frame camera, whose images are free of distortion.
        frame_size: height and width of its images.
    """

    matrix: NDArray[np.float64]
    distortion: NDArray[np.float64]
    size: tuple[int, int]
    rotation: NDArray[np.float64]
    frame_matrix: NDArray[np.float64]
    frame_size: tuple[int, int]

    def positions(self, columns: NDArray[np.float64], rows: NDArray[np.float64]) -> Positions:
        """Where in the image points of the event camera's view lie, columns and rows in pixels."""
        fx, fy, cx, cy = self.matrix
        x, y = undistorted((columns - cx) / fx, (rows - cy) / fy, self.distortion)
        u, v, w = np.tensordot(self.rotation, np.stack([x, y, np.ones_like(x)]), 1)
        fx, fy, cx, cy = self.frame_matrix
        return fx * u / w + cx, fy * v / w + cy

    def covered(self) -> NDArray[np.bool_]:
        """Which pixels of the event camera have their centre in the image, shape `size`."""
        rows, columns = np.indices(self.size, np.float64)
        return inside(*self.positions(columns, rows), self.frame_size)

    def weights(self, samples: int = 4) -> sparse.csr_matrix:
        """What each pixel of the event camera gathers of the pixels of an image.

        A pixel is the mean of `samples` x `samples` points spread over its area, each read between
        the four pixels around it, so detail finer than a pixel is averaged and does not flicker as
        it moves. The weights of a pixel add up to one; those of an uncovered pixel are zero.

        Returns:
            float32, shape (pixels of the event camera, pixels of the image).
        """
        height = self.size[0]
        bands = [
            self._band(np.arange(first, min(first + BAND, height)), samples)
            for first in range(0, height, BAND)
        ]
        gathered = sparse.vstack(bands, format="csr")
        sums = np.asarray(gathered.sum(axis=1)).ravel()
        kept = np.where(self.covered().ravel() & (sums > 0), 1 / np.maximum(sums, 1e-9), 0)
        return sparse.csr_matrix(sparse.diags(kept) @ gathered, dtype=np.float32)

    def _band(self, rows: NDArray[np.int64], samples: int) -> sparse.csr_matrix:
        width = self.size[1]
        steps = (np.arange(samples) + 0.5) / samples - 0.5
        row, column, down, right = np.meshgrid(rows, np.arange(width), steps, steps, indexing="ij")
        columns, lines = (np.float64(each).ravel() for each in (column + right, row + down))
        u, v = self.positions(columns, lines)
        pixel = ((row - rows[0]) * width + column).ravel().astype(np.int64)
        seen = inside(u, v, self.frame_size)
        u, v, pixel = u[seen], v[seen], pixel[seen]
        height_f, width_f = self.frame_size
        left = np.minimum(np.floor(u), width_f - 2).astype(np.int64)
        top = np.minimum(np.floor(v), height_f - 2).astype(np.int64)
        du, dv = u - left, v - top
        shares = [(1 - du) * (1 - dv), du * (1 - dv), (1 - du) * dv, du * dv]
        at = top * width_f + left
        sources = np.concatenate([at, at + 1, at + width_f, at + width_f + 1])
        shape = len(rows) * width, height_f * width_f
        return sparse.csr_matrix(
            (np.concatenate(shares), (np.tile(pixel, 4), sources)), shape=shape
        )


Positions = tuple[NDArray[np.float64], NDArray[np.float64]]


def undistorted(
    x: NDArray[np.float64], y: NDArray[np.float64], distortion: NDArray[np.float64]
) -> Positions:
    """The undistorted ray of each distorted one, both as x / z and y / z.

    Raises:
        ValueError: the distortion is too strong to be undone.

    Example:
        >>> x, y = np.array([0.3]), np.array([-0.2])
        >>> lens = np.array([-0.1, 0.2, 0.001, -0.002])
        >>> back = distorted(*undistorted(x, y, lens), lens)
        >>> bool(np.allclose(back, (x, y), atol=1e-10))
        True
    """
    found_x, found_y = x, y
    for _ in range(MOST_STEPS):
        there_x, there_y = distorted(found_x, found_y, distortion)
        step_x, step_y = x - there_x, y - there_y
        found_x, found_y = found_x + step_x, found_y + step_y
        step = max(np.abs(step_x).max(initial=0), np.abs(step_y).max(initial=0))
        if step < UNDISTORTED:
            return found_x, found_y
        if not step < FAR:
            break
    raise ValueError(
        f"Expected a distortion that can be undone, got {distortion.tolist()}; check the file"
    )


def distorted(
    x: NDArray[np.float64], y: NDArray[np.float64], distortion: NDArray[np.float64]
) -> Positions:
    """Rays after the lens, with k1, k2 of the radial and p1, p2 of the tangential distortion."""
    k1, k2, p1, p2 = distortion
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * k2)
    return (
        x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
        y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
    )


def inside(
    columns: NDArray[np.float64], rows: NDArray[np.float64], size: tuple[int, int]
) -> NDArray[np.bool_]:
    """Which positions lie between pixel centres of an image of this height and width."""
    height, width = size
    return (columns >= 0) & (columns <= width - 1) & (rows >= 0) & (rows <= height - 1)


def remapped(
    weights: sparse.csr_matrix, image: NDArray[np.uint8], size: tuple[int, int]
) -> NDArray[np.uint8]:
    """An image, grey or RGB, as the event camera of this height and width sees it, uint8."""
    flat = image.reshape(image.shape[0] * image.shape[1], -1).astype(np.float32)
    gathered: NDArray[np.uint8] = np.rint(weights @ flat).clip(0, 255).astype(np.uint8)
    return gathered.reshape(*size, *image.shape[2:])
