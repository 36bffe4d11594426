"""Images at the depth they are stored with, upright, and opaque."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from eqs.extras import needed
from eqs.frames.exr import SUFFIX, exr_size, read_exr

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".npy", SUFFIX)
GREY_MODES = ("L", "1")
COLOUR_MODES = ("RGB", "P")
ALPHA_MODES = {"LA": "L", "PA": "RGB", "RGBA": "RGB", "La": "L", "RGBa": "RGB"}
DEEP_GREY_MODES = ("I;16", "I;16B", "I;16L", "I;16N", "I")
ORIENTATION, BITS_PER_SAMPLE = 0x0112, 258  # tags of EXIF and of TIFF
SIDEWAYS = (5, 6, 7, 8)


def read_image(path: Path | str, white: float | None = None) -> NDArray[Any]:
    """Read an image as grey `(H, W)` or RGB `(H, W, 3)`, turned as its metadata say.

    Convention: grey levels run from 0 to 255. Images of 8 bits are uint8; those of 16 bits and
    floating ones are float32 and keep all of their depth. Alpha is left out where all is opaque.

    Args:
        path: the file; a renderer's arrays come as `.npy`, (H, W) or (H, W, 3), or as `.exr`.
        white: level that is white in floating images; whole numbers say it by their depth.

    Raises:
        ValueError: the file is no readable image of 8 or 16 bits, is transparent somewhere, is a
            TIFF on its side, or is floating and nobody says what is white; or OpenCV, the optional
            dependency `flow`, is not installed, which 16 bits of colour take, or OpenEXR, `exr`.
    """
    if Path(path).suffix.lower() == ".npy":
        return _of_array(_array(path), white, path)
    if Path(path).suffix.lower() == SUFFIX:
        return _of_exr(read_exr(path), white, path)
    try:
        with Image.open(path) as image:
            upright = _orientation(image)
            if image.mode == "F":
                return _turned(_levels(np.asarray(image), white, path), upright)
            bits = _bits(image, Path(path))
            if bits > 8:
                return _turned(_deep(image, bits, path), upright)
            return _turned(_shallow(image, path), upright)
    except (UnidentifiedImageError, OSError, SyntaxError) as error:
        raise ValueError(f"Expected a readable image, got {path}: {error}") from error


def image_size(path: Path | str) -> tuple[int, int]:
    """Height and width of an image as `read_image` gives it, without decoding it.

    Raises:
        ValueError: the file is no readable image.
    """
    if Path(path).suffix.lower() == ".npy":
        height, width = _array(path).shape[:2]
        return height, width
    if Path(path).suffix.lower() == SUFFIX:
        return exr_size(path)
    try:
        with Image.open(path) as image:
            width, height = image.size
            return (width, height) if _orientation(image) in SIDEWAYS else (height, width)
    except (UnidentifiedImageError, OSError, SyntaxError) as error:
        raise ValueError(f"Expected an image at {path}, got: {error}; replace it") from error


def _array(path: Path | str) -> NDArray[Any]:
    """An array on disk, of which nothing is read yet."""
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise ValueError(f"Expected a readable array at {path}, got: {error}") from error
    if not isinstance(array, np.ndarray) or array.ndim not in (2, 3) or array.shape[2:] not in (
        (), (3,)
    ):  # fmt: skip
        raise ValueError(
            f"Expected an image shaped (H, W) or (H, W, 3) in {path}, got "
            f"{getattr(array, 'shape', 'several')}; save one frame a file"
        )
    return array


def _of_array(array: NDArray[Any], white: float | None, path: Path | str) -> NDArray[Any]:
    if array.dtype == np.uint8:
        return np.array(array)
    if array.dtype == np.uint16:
        return _scaled(np.asarray(array))
    if array.dtype.kind == "f":
        return _levels(np.asarray(array, np.float64), white, path)
    raise ValueError(
        f"Expected 8 or 16 bits or floating numbers in {path}, got {array.dtype}; convert it"
    )


def _of_exr(levels: NDArray[np.float32], white: float | None, path: Path | str) -> NDArray[Any]:
    if levels.ndim == 3 and levels.shape[2] == 4:
        require_opaque(levels[..., 3] >= 1, path)
        levels = levels[..., :3]
    return _levels(levels.astype(np.float64), white, path)


def _orientation(image: Image.Image) -> int:
    orientation = int(image.getexif().get(ORIENTATION, 1))
    if image.format != "TIFF":
        return orientation
    if orientation in SIDEWAYS:  # which the library mixes up; the others it turns by itself
        raise ValueError(
            f"Expected a TIFF that is stored upright, got orientation {orientation} in "
            f"{getattr(image, 'filename', 'it')}; save it upright, or as PNG"
        )
    return 1


def _turned(array: NDArray[Any], orientation: int) -> NDArray[Any]:
    """The picture as it was seen, by EXIF's orientation, 1 to 8."""
    if orientation in SIDEWAYS:
        array = array.swapaxes(0, 1)
    if orientation in (2, 3, 6, 7):
        array = array[:, ::-1]
    if orientation in (3, 4, 7, 8):
        array = array[::-1]
    return np.ascontiguousarray(array)


def _bits(image: Image.Image, path: Path) -> int:
    """Bits of a channel, where the library would cut them to eight without a word."""
    if image.format == "PNG":
        with path.open("rb") as file:
            return file.read(25)[24]
    tags = getattr(image, "tag_v2", {})
    bits = tags.get(BITS_PER_SAMPLE, 16 if image.mode in DEEP_GREY_MODES else 8)
    return max(bits) if isinstance(bits, tuple) else int(bits)


def _shallow(image: Image.Image, path: Path | str) -> NDArray[np.uint8]:
    mode = image.mode
    if mode == "P" and "transparency" in image.info:
        mode, image = "RGBA", image.convert("RGBA")
    if mode in ALPHA_MODES:
        bands = image.convert("RGBA")
        require_opaque(np.asarray(bands)[..., 3] == 255, path)
        return np.asarray(bands.convert(ALPHA_MODES[mode]))
    if mode not in GREY_MODES + COLOUR_MODES:
        raise ValueError(
            f"Expected a grey or colour image of 8 or 16 bits, got mode {mode} in {path}; "
            "convert it first"
        )
    return np.asarray(image.convert("L" if mode in GREY_MODES else "RGB"))


def _deep(image: Image.Image, bits: int, path: Path | str) -> NDArray[np.float32]:
    if bits != 16:
        raise ValueError(f"Expected an image of 8 or 16 bits, got {bits} in {path}; convert it")
    if image.mode in DEEP_GREY_MODES:
        return _scaled(np.asarray(image))
    with needed("flow", f"to read 16 bits of colour in {path}"):
        import cv2
    values = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if values is None or values.dtype != np.uint16:
        raise ValueError(f"Expected an image of 8 or 16 bits, got another in {path}; convert it")
    if values.ndim == 3 and values.shape[2] == 4:
        require_opaque(values[..., 3] == 65535, path)
        values = values[..., :3]
    return _scaled(values[..., ::-1] if values.ndim == 3 else values)


def _scaled(values: NDArray[Any]) -> NDArray[np.float32]:
    return (values.astype(np.float64) * (255 / 65535)).astype(np.float32)


def _levels(values: NDArray[Any], white: float | None, path: Path | str) -> NDArray[np.float32]:
    if white is None:
        raise ValueError(
            f"Expected to know which level is white in the floating image {path}, got no word of "
            f"it (its levels go to {values.max():g}); set white=1 or white=255, or convert it to "
            "16 bits"
        )
    return (values * (255 / white)).astype(np.float32)


def require_opaque(opaque: NDArray[np.bool_], path: Path | str) -> None:
    """Refuse a picture through which some background shows.

    Raises:
        ValueError: a pixel is transparent.
    """
    if not opaque.all():
        raise ValueError(
            f"Expected an opaque picture, got {int((~opaque).sum())} transparent pixels in {path}; "
            "put it on a background first"
        )
