"""OpenEXR images of renderers: floating levels of linear light."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.extras import needed

SUFFIX = ".exr"
GREY = "Y"
WINDOWS = ("dataWindow", "displayWindow")  # what is stored, and what is to be seen


def read_exr(path: Path | str) -> NDArray[np.float32]:
    """The levels of an OpenEXR image, grey `(H, W)`, or `(H, W, 3)` or `(H, W, 4)` with alpha.

    Of several layers the one called `Combined` counts, which is what Blender calls the picture.

    Raises:
        ValueError: the file is no readable image, has no grey or colour, or is a part of a larger
            picture; or OpenEXR, the optional dependency `exr`, is not installed.
    """
    header, channels = _opened(path, header_only=False)
    _size(header, path)
    return np.array(_colour(channels, path), np.float32)


def exr_size(path: Path | str) -> tuple[int, int]:
    """Height and width of an OpenEXR image, without decoding it.

    Raises:
        ValueError: the file is no readable image, or a part of a larger picture.
    """
    return _size(_opened(path, header_only=True)[0], path)


def _opened(
    path: Path | str, *, header_only: bool
) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """The header of the first part, and the pixels of its channels, or none of them."""
    with needed("exr", f"to read {path}"):
        import OpenEXR
    try:
        with OpenEXR.File(str(path), header_only=header_only) as file:
            header = {name: np.array(file.header()[name]) for name in WINDOWS}
            channels = {} if header_only else file.channels()
            # The library keeps what it gave for as long as the file is open.
            return header, {name: np.array(each.pixels) for name, each in channels.items()}
    except (RuntimeError, OSError, TypeError, ValueError, KeyError) as error:
        raise ValueError(f"Expected a readable OpenEXR image, got {path}: {error}") from error


def _size(header: dict[str, Any], path: Path | str) -> tuple[int, int]:
    stored, shown = (header[name] for name in WINDOWS)
    if not np.array_equal(stored, shown):
        raise ValueError(
            f"Expected a whole picture in {path}, got a part of a larger one; render without a "
            "border or an overscan"
        )
    (left, top), (right, bottom) = stored.tolist()
    return bottom - top + 1, right - left + 1


def _colour(channels: dict[str, NDArray[Any]], path: Path | str) -> NDArray[Any]:
    """The pixels of the only colour, or of the layer that is the picture."""
    found = {name: pixels for name, pixels in channels.items() if _is_colour(name, pixels)}
    combined = {name: each for name, each in found.items() if "Combined" in name.split(".")}
    chosen = combined if len(found) > 1 else found
    if len(chosen) != 1:
        raise ValueError(
            f"Expected grey or colour in {path}, got {', '.join(channels) or 'none'}; save one "
            "layer of R, G, B or Y"
        )
    return next(iter(chosen.values()))


def _is_colour(name: str, pixels: NDArray[Any]) -> bool:
    """Whether a channel is grey, or red, green and blue that the library put together."""
    return pixels.ndim == 3 or name.rpartition(".")[2] == GREY
