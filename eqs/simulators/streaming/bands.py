"""A sensor in horizontal bands that are simulated side by side."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.simulators.streaming.pixels import Begin, Interval, Pixels


class BandedPixels:
    """The pixels of a sensor, each band with a state of its own.

    Bands know which pixel of the sensor is their first, and draws are keyed by pixel, so the events
    do not depend on the number of bands.

    Args:
        begin: makes the pixels of a part of the sensor after its first image.
        image: the first image.
        bands: how many bands there may be.
    """

    def __init__(self, begin: Begin, image: GreyImage, bands: int) -> None:
        """Settle every band on the first image."""
        self.bands = bands
        self.parts = [begin(part) for part in image.bands(bands)]

    def advance(self, image: GreyImage, interval: Interval) -> NDArray[np.int64]:
        """Events of one interval, band by band and so still row by row."""
        images = image.bands(self.bands)

        def keys_of(part: Pixels, own: GreyImage) -> NDArray[np.int64]:
            return part.advance(own, interval) + (own.first_pixel << 1)

        with ThreadPoolExecutor(max(1, len(images) - 1)) as beside:
            later = [
                beside.submit(keys_of, *each)
                for each in zip(self.parts[1:], images[1:], strict=True)
            ]
            first = keys_of(self.parts[0], images[0])
            return np.concatenate([first, *(part.result() for part in later)])
