"""The pictures of a page: events, and where two streams differ, as small PNGs in data URIs."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from eqs.events import Events

MOST_WINDOWS: Final = 200
LONGEST_SIDE: Final = 320
MOST_BYTES: Final = 6_000_000
PALETTE: Final = (255, 255, 255, 215, 48, 31, 44, 95, 209)  # nothing, darker, brighter
LEVELS: Final = 255  # colours of a map; the one after them is for nothing
AGREE, DIFFER, NOTHING = (255, 250, 240), (103, 0, 60), (190, 190, 190)


@dataclass(frozen=True, kw_only=True)
class PageWindows:
    """The windows that a page shows.

    Args:
        numbers: which windows of the score.
        simulated: pictures of the simulated stream, as data URIs.
        real: of the real stream.
        maps: of the similarity between them.
    """

    numbers: Sequence[int]
    simulated: Sequence[str]
    real: Sequence[str]
    maps: Sequence[str]

    def within(self, most_bytes: int = MOST_BYTES) -> PageWindows:
        """As many of the windows, evenly chosen, as fit; at least one."""
        sizes = [len(a) + len(b) + len(c)
                 for a, b, c in zip(self.simulated, self.real, self.maps, strict=True)]  # fmt: skip
        kept = list(range(len(self.numbers)))
        while len(kept) > 1 and sum(sizes[index] for index in kept) > most_bytes:
            kept = kept[::2]
        return PageWindows(
            numbers=[self.numbers[index] for index in kept],
            simulated=[self.simulated[index] for index in kept],
            real=[self.real[index] for index in kept],
            maps=[self.maps[index] for index in kept],
        )


def shown_windows(count: int) -> list[int]:
    """Numbers of the windows that a page shows, at most so many, evenly chosen.

    Example:
        >>> shown_windows(5), len(shown_windows(5000))
        ([0, 1, 2, 3, 4], 200)
    """
    most = min(count, MOST_WINDOWS)
    chosen: list[int] = np.unique(np.linspace(0, count - 1, most).round().astype(int)).tolist()
    return chosen


def shrinking(height: int, width: int) -> int:
    """How many pixels of the sensor's side one of a picture stands for.

    Example:
        >>> shrinking(260, 346), shrinking(480, 640), shrinking(240, 320)
        (2, 2, 1)
    """
    return -(-max(height, width) // LONGEST_SIDE)


def event_uri(events: Events) -> str:
    """The last event of every pixel, or few pixels, as a PNG in three colours, as a data URI."""
    step = shrinking(events.height, events.width)
    image = np.zeros((-(-events.height // step), -(-events.width // step)), np.uint8)
    # Assigned in order of time, so that the last event stays.
    image[events.y // step, events.x // step] = 1 + events.p
    return _uri(image, PALETTE, bits=2)


def map_uri(
    similarity: NDArray[np.floating[Any]], patch_px: int | None, height: int, width: int
) -> str:
    """A map as a PNG: pale where streams agree, dark where they differ, grey where nothing counts.

    Args:
        similarity: by patch, shape (rows, columns); NaN where nothing counts.
        patch_px: side of a patch in pixels; None where the patches divide the image evenly.
        height: rows of the sensor.
        width: columns of the sensor.
    """
    known = np.clip(np.nan_to_num(np.asarray(similarity, dtype=float), nan=0.0), 0.0, 1.0)
    level = np.where(np.isnan(similarity), LEVELS, np.rint(known * (LEVELS - 1))).astype(np.uint8)
    step, (rows, columns) = shrinking(height, width), similarity.shape
    high = height / rows if patch_px is None else patch_px
    wide = width / columns if patch_px is None else patch_px
    at_row = np.arange(0, height, step) / high
    at_column = np.arange(0, width, step) / wide
    image = level[np.ix_(at_row.astype(int), at_column.astype(int))]
    return _uri(image, map_palette())


def map_palette() -> tuple[int, ...]:
    """Colours of a map from differing to agreeing, and that of nothing."""
    ramp = np.linspace(DIFFER, AGREE, LEVELS).round().astype(int)
    return (*map(int, ramp.ravel()), *NOTHING)


def _uri(image: NDArray[np.uint8], palette: Sequence[int], **options: Any) -> str:  # noqa: ANN401
    picture, buffer = Image.fromarray(image).convert("P"), io.BytesIO()
    picture.putpalette(palette)
    picture.save(buffer, "PNG", compress_level=9, **options)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")
