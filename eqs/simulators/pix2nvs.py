"""PIX2NVS: thresholded log-luma differences with per-pixel adaptive thresholds.

Bi and Andreopoulos, "PIX2NVS: Parameterized Conversion of Pixel-Domain Video Frames to Neuromorphic
Vision Streams", ICIP 2017.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from eqs.frames import GreyImage
from eqs.kernels import njit
from eqs.simulators.base import Simulator, require_positive
from eqs.simulators.streaming.keys import event_key, with_room
from eqs.simulators.streaming.pixels import Interval

REFERENCE_UPDATES = ("previous", "replace", "integrate", "never")
BLOCKS = (1, 2, 4)
_PREVIOUS, _REPLACE, _INTEGRATE, _NEVER = range(4)

Held = tuple[NDArray[np.float64], NDArray[Any]]
"""References, and the place of each pixel's among them."""


@dataclass(frozen=True, kw_only=True)
class PIX2NVS(Simulator):
    """Compares each frame's log luma with a reference and spreads the events over the interval.

    The pixel of each block that differs most fires `min(max_events, |d| / threshold)` events at
    shares `i threshold / |d|` of the interval, which are the crossings of a line from the
    reference. A pixel's threshold grows by the share `adaptation` at each frame in which it fires
    and shrinks by it in the others. There is no randomness. Black counts as grey level 1, whose
    logarithm exists.

    In `fixed` mode events lie within the interval in which the change happened, and adaptation
    keeps thresholds between `threshold_min_log` and `threshold_max_log`, the range the program
    allows for its own parameter. In `faithful` mode events come one frame later, and thresholds
    adapt without bounds, so that every pixel fires in 51 % of the frames whatever it sees.

    Args:
        threshold_log: contrast of an event at the start, natural-log units.
        threshold_min_log: least threshold in `fixed` mode.
        threshold_max_log: greatest threshold in `fixed` mode.
        adaptation: share by which thresholds change each frame, 0 for constant ones.
        reference_update: what the reference becomes: the `previous` frame; at pixels that fired
            the current value (`replace`) or the last level fired (`integrate`, from a reference of
            zero, so that a clip begins with a burst of ON events); or `never` anything but the
            first frame.
        max_events: most events of a pixel in one interval; contrast beyond is lost, except with
            `integrate`.
        block: side of the blocks in which a single pixel may fire, 1, 2 or 4.

    Raises:
        ValueError: a parameter lies outside its range.

    Example:
        >>> frames = np.array([np.full((1, 1), level) for level in (64.0, 128.0)])
        >>> PIX2NVS(threshold_log=0.2).simulate(frames, [0, 70_000]).t.tolist()
        [20197, 40395, 60593]
    """

    name: ClassVar[str] = "pix2nvs"
    rounds_luma: ClassVar[bool] = False

    threshold_log: float = 0.4
    threshold_min_log: float = 0.2
    threshold_max_log: float = 0.7
    adaptation: float = 0.05
    reference_update: str = "previous"
    max_events: int = 5
    block: int = 1

    def __post_init__(self) -> None:
        """Check the parameters."""
        super().__post_init__()
        require_positive(self, "threshold_log", "threshold_min_log", "threshold_max_log")
        inside = self.threshold_min_log <= self.threshold_log <= self.threshold_max_log
        if self.mode == "fixed" and not inside:
            raise ValueError(
                f"Expected threshold_log from {self.threshold_min_log} to "
                f"{self.threshold_max_log}, got {self.threshold_log}; set sim.threshold_log, "
                "sim.threshold_min_log or sim.threshold_max_log"
            )
        if not 0 <= self.adaptation < 1:
            raise ValueError(
                f"Expected adaptation of at least 0 and below 1, got {self.adaptation}; "
                "set sim.adaptation"
            )
        if self.reference_update not in REFERENCE_UPDATES:
            raise ValueError(
                f"Expected reference_update to be one of {', '.join(REFERENCE_UPDATES)}, got "
                f"{self.reference_update!r}; set sim.reference_update"
            )
        if self.max_events < 1:
            raise ValueError(
                f"Expected max_events of 1 or more, got {self.max_events}; set sim.max_events"
            )
        if self.block not in BLOCKS:
            raise ValueError(f"Expected block 1, 2 or 4, got {self.block}; set sim.block")


def log_luma(levels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Natural log of the grey level, black counted as level 1.

    Example:
        >>> log_luma(np.array([0.0, 1.0, 255.0])).round(3).tolist()
        [0.0, 0.0, 5.541]
    """
    return np.log(np.maximum(levels, 1.0))


class PIX2NVSPixels:
    """References and thresholds of all pixels."""

    def __init__(self, model: PIX2NVS, image: GreyImage, sequence: str) -> None:
        """Settle on the first image."""
        self.model = model
        self.update = REFERENCE_UPDATES.index(model.reference_update)
        pixels = image.codes.size
        # The reference of a pixel is `reference[places[pixel]]`: a table for the previous frame.
        self.reference, self.places = log_luma(image.levels), image.codes
        if self.update != _PREVIOUS:
            self.reference = self.reference[image.codes]
            self.places = np.arange(pixels, dtype=np.uint32)
        if self.update == _INTEGRATE:
            self.reference[:] = 0.0
        self.threshold = np.full(pixels, float(model.threshold_log))
        blocks = -(-image.height // model.block) * -(-image.width // model.block)
        self.candidates = np.arange(blocks, dtype=np.uint32)  # a pixel is a block
        self.chosen = np.empty(blocks, np.uint32)
        self.numbers = np.empty(blocks, np.int64)
        self.keys = np.empty(pixels, np.int64)

    def advance(self, image: GreyImage, interval: Interval) -> NDArray[np.int64]:
        """Events of one interval."""
        model = self.model
        fixed = model.mode == "fixed"
        smallest_log = model.threshold_min_log if fixed else 0.0
        signal, adaptation = log_luma(image.levels), float(model.adaptation)
        held = self.reference, self.places
        if model.block > 1:
            shape = (image.height, image.width, model.block)
            _strongest_of_blocks(image.codes, signal, held, shape, self.candidates)
        firing, total = _firing(
            self.candidates,
            image.codes,
            signal,
            held,
            self.threshold,
            smallest_log,
            adaptation,
            model.max_events,
            self.chosen,
            self.numbers,
        )
        self.keys = with_room(self.keys, total)
        _fire(
            self.chosen[:firing],
            self.numbers,
            image.codes,
            signal,
            held,
            self.threshold,
            model.threshold_max_log if fixed else math.inf,
            adaptation,
            self.update,
            # The program stamps one interval late, and rounds where we floor.
            interval.start_us if fixed else interval.stop_us,
            0.0 if fixed else 0.5,
            interval.span_us,
            self.keys,
        )
        if self.update == _PREVIOUS:
            self.reference, self.places = signal, image.codes
        return self.keys[:total]


@njit(cache=True)
def _strongest(
    codes: NDArray[Any],
    signal: NDArray[np.float64],
    held: Held,
    rows: tuple[int, int],
    columns: tuple[int, int],
    width: int,
) -> int:
    """The pixel of a block whose signal differs most from its reference."""
    winner, largest = rows[0] * width + columns[0], -1.0
    for y in range(rows[0], rows[1]):
        for x in range(columns[0], columns[1]):
            pixel = y * width + x
            distance = abs(signal[codes[pixel]] - held[0][held[1][pixel]])
            if distance > largest:
                winner, largest = pixel, distance
    return winner


@njit(cache=True, nogil=True)
def _strongest_of_blocks(
    codes: NDArray[Any],
    signal: NDArray[np.float64],
    held: Held,
    shape: tuple[int, int, int],
    candidates: NDArray[np.uint32],
) -> None:
    height, width, block = shape
    count = 0
    for top in range(0, height, block):
        rows = (top, min(top + block, height))
        for left in range(0, width, block):
            columns = (left, min(left + block, width))
            candidates[count] = _strongest(codes, signal, held, rows, columns, width)
            count += 1


@njit(cache=True, nogil=True)
def _firing(
    candidates: NDArray[np.uint32],
    codes: NDArray[Any],
    signal: NDArray[np.float64],
    held: Held,
    threshold: NDArray[np.float64],
    smallest_log: float,
    adaptation: float,
    max_events: int,
    chosen: NDArray[np.uint32],
    numbers: NDArray[np.int64],
) -> tuple[int, int]:
    """Write the candidates that fire to `chosen`, with signed `numbers`; the others adapt."""
    reference, places = held
    count = 0
    for pixel in candidates:
        limit = threshold[pixel]
        fires = abs(signal[codes[pixel]] - reference[places[pixel]]) > limit
        # Written in either case: a branch would cost more.
        chosen[count] = pixel
        count += fires
        threshold[pixel] = limit if fires else max(limit * (1.0 - adaptation), smallest_log)
    total = 0
    for index in range(count):
        pixel = chosen[index]
        difference = signal[codes[pixel]] - reference[places[pixel]]
        number = int(min(abs(difference) / threshold[pixel], float(max_events)))
        numbers[index] = number if difference > 0 else -number
        total += number
    return count, total


@njit(cache=True, nogil=True)
def _fire(
    chosen: NDArray[np.uint32],
    numbers: NDArray[np.int64],
    codes: NDArray[Any],
    signal: NDArray[np.float64],
    held: Held,
    threshold: NDArray[np.float64],
    largest_log: float,
    adaptation: float,
    update: int,
    base_us: int,
    rounding: float,
    span_us: int,
    keys: NDArray[np.int64],
) -> None:
    """Fire the chosen pixels, which adapt the other way."""
    reference, places = held
    count = 0
    for index in range(chosen.size):
        pixel, number = chosen[index], numbers[index]
        limit, value = threshold[pixel], signal[codes[pixel]]
        distance = abs(value - reference[places[pixel]])
        polarity = 1 if number > 0 else 0
        for ordinal in range(1, abs(number) + 1):
            offset_us = int(ordinal * limit / distance * span_us + rounding)
            keys[count] = event_key(base_us + offset_us, pixel, polarity)
            count += 1
        if update == _REPLACE:
            reference[pixel] = value
        elif update == _INTEGRATE:
            reference[pixel] += number * limit
        threshold[pixel] = min(limit * (1.0 + adaptation), largest_log)


PIX2NVS.pixels = dict.fromkeys(("fixed", "faithful"), PIX2NVSPixels)
