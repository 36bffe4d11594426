"""The times of a folder's frames, in whatever unit the program that made them wrote."""

from __future__ import annotations

import re
from collections.abc import Sequence
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

TIMES = "timestamps.txt"
# Microseconds in each unit, as decimal numbers, so that no time is rounded twice.
UNITS = {"s": Decimal(1_000_000), "ms": Decimal(1000), "us": Decimal(1), "ns": Decimal("0.001")}
LATEST_US = 1 << 62


def times_file(folder: Path, time_unit: str | None = None) -> tuple[Path, str] | None:
    """The file with the times of a folder's frames, in it or beside it, and their unit.

    `timestamps.txt` counts in `time_unit`, in microseconds where nobody says; the name of
    `timestamps_ns.txt` and the like says the unit itself.

    Raises:
        ValueError: the unit is none, there are several such files, or name and unit differ.
    """
    if time_unit is not None and time_unit not in UNITS:
        raise ValueError(
            f"Expected a unit among {', '.join(UNITS)}, got {time_unit!r}; set time_unit"
        )
    for place in (folder, folder.parent):
        units: dict[str, str | None] = {TIMES: None, **{f"timestamps_{u}.txt": u for u in UNITS}}
        found = [place / name for name in units if (place / name).is_file()]
        if len(found) > 1:
            raise ValueError(
                f"Expected one file of times in {place}, got "
                f"{' and '.join(path.name for path in found)}; keep one"
            )
        if found:
            told = units[found[0].name]
            if told and time_unit and told != time_unit:
                raise ValueError(
                    f"Expected times in {time_unit}, got {found[0]}; leave time_unit out"
                )
            return found[0], told or time_unit or "us"
    return None


def frame_times(path: Path, unit: str, images: Sequence[Path]) -> NDArray[np.int64]:
    """The time of each image, whole microseconds.

    Convention: a time between two microseconds becomes the nearer one, since the clocks of engines
    add up steps that are no whole microseconds. Lines of one number belong to the images in their
    order; in lines of two the first is the number of an image, the last in its name, and numbers
    that no image has are left out.

    Args:
        path: the file, one frame a line; commas, spaces and lines that begin with # are allowed.
        unit: unit of the times, s, ms, us or ns.
        images: the images in their order.

    Raises:
        ValueError: the file holds something else, microseconds or nanoseconds that are not whole,
            or no time for an image.
    """
    lines = [re.split(r"[,\s]+", line.strip().rstrip(",")) for line in _lines(path)]
    columns = {len(line) for line in lines}
    if len(columns) != 1 or not columns <= {1, 2}:
        raise ValueError(
            f"Expected a time a line in {path}, or a frame's number and its time, got lines of "
            f"{sorted(columns) or 'no'} numbers; write one row a line"
        )
    times_us = [_microseconds(line[-1], unit, path) for line in lines]
    if columns == {1}:
        return np.array(times_us, np.int64)
    try:
        numbered = {int(line[0]): time_us for line, time_us in zip(lines, times_us, strict=True)}
    except ValueError as error:
        raise ValueError(f"Expected a frame's whole number in {path}, got: {error}") from error
    if len(numbered) != len(lines):
        raise ValueError(f"Expected every frame once in {path}, got a number twice; keep one")
    return np.array([_of_image(numbered, image, path) for image in images], np.int64)


def _lines(path: Path) -> list[str]:
    try:
        lines = path.read_text().splitlines()
    except ValueError as error:
        raise ValueError(f"Expected times as text in {path}, got: {error}") from error
    return [line for line in lines if line.strip() and not line.lstrip().startswith("#")]


def _microseconds(text: str, unit: str, path: Path) -> int:
    try:
        value = Decimal(text)
    except InvalidOperation:
        value = Decimal("inf")
    if value.is_nan() or abs(value) >= LATEST_US:
        raise ValueError(f"Expected times in {unit} in {path}, got {text!r}; write numbers alone")
    if unit in ("us", "ns") and value != value.to_integral_value():
        said = {"us": "microseconds", "ns": "nanoseconds"}[unit]
        raise ValueError(
            f"Expected whole {said} in {path}, got {text}; set time_unit=s if these are seconds"
        )
    return int((value * UNITS[unit]).to_integral_value())


def frame_number(image: Path) -> int | None:
    """The last number in the name of an image, with which engines count frames.

    Example:
        >>> frame_number(Path("cam2_000123.png")), frame_number(Path("last.png"))
        (123, None)
    """
    numbers = re.findall(r"\d+", image.stem)
    return int(numbers[-1]) if numbers else None


def _of_image(numbered: dict[int, int], image: Path, path: Path) -> int:
    number = frame_number(image)
    if number not in numbered:
        raise ValueError(f"Expected a time for frame {number} ({image.name}) in {path}, got none")
    return numbered[number]


def counted_times(
    images: Sequence[Path], frames_per_second: float, frame_numbers: bool | None
) -> NDArray[np.int64]:
    """Times of frames that come at a fixed rate, the first at zero, rounded down.

    Args:
        images: the images in their order.
        frames_per_second: the rate.
        frame_numbers: whether the numbers in the names count frames, so that a gap is a time; None
            where they have no gap, or where all gaps are alike.

    Raises:
        ValueError: numbers have gaps and nobody says what they mean, or an image has none.
    """
    counts = np.arange(len(images), dtype=np.int64)
    numbers = [frame_number(image) for image in images]
    known = np.array([number for number in numbers if number is not None], np.int64)
    if frame_numbers is False or (frame_numbers is None and len(known) < len(images)):
        pass
    elif len(known) < len(images):
        raise ValueError("Expected a number in the name of every frame, got none; leave out "
                         "frame_numbers")  # fmt: skip
    elif frame_numbers:
        counts = known - known[0]
    elif len(steps := np.unique(np.diff(known))) > 1:
        raise ValueError(
            f"Expected frames numbered at equal steps in {images[0].parent}, got steps of "
            f"{steps[0]} to {steps[-1]}; set frame_numbers=true if the numbers count frames of the "
            "rate, frame_numbers=false if the images follow each other all the same"
        )
    times = np.floor(counts * 1_000_000 / frames_per_second)
    return times.astype(np.int64)
