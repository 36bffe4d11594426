"""The order of frames by the numbers in their names."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from decimal import Decimal
from pathlib import Path

Key = tuple[tuple[int, str, int], ...]


def natural_key(name: str) -> Key:
    """What sorts names as people count: runs of digits by their number, the rest as text.

    Example:
        >>> sorted(["frame_10", "frame_2", "frame_1"], key=natural_key)
        ['frame_1', 'frame_2', 'frame_10']
    """
    parts = re.split(r"(\d+)", name)
    # Text sorts with text and numbers with numbers, whatever a name begins with.
    return tuple(
        (1, "", int(part)) if index % 2 else (0, part.lower(), 0)
        for index, part in enumerate(parts)
        if part
    )


def by_name(paths: Iterable[Path]) -> list[Path]:
    """Files or folders in the natural order of their names."""
    return sorted(paths, key=lambda path: (natural_key(path.name), path.name))


def frame_order(paths: Iterable[Path]) -> list[Path]:
    """The frames of a folder in the order of their numbers.

    Names without numbers stand in the order of the alphabet.

    Raises:
        ValueError: the names admit two orders: two have the same number, as 1.png and 01.png or the
            frames of two cameras do, or numbers with a point count otherwise than the digits behind
            it.

    Example:
        >>> [path.name for path in frame_order(map(Path, ["f10.png", "f9.png"]))]
        ['f9.png', 'f10.png']
    """
    ordered = sorted(paths, key=lambda path: (natural_key(path.stem), path.name))
    stems = [path.stem for path in ordered]
    if not any(re.search(r"\d", stem) for stem in stems):
        readings: list[Callable[[str], object]] = [str.lower]
    else:
        readings = [natural_key, _numbers, _decimals]
    for reading in readings:
        keys = [reading(stem) for stem in stems]
        fault = next((k for k in range(1, len(keys)) if not keys[k - 1] < keys[k]), None)  # type: ignore[operator]
        if fault is not None:
            raise ValueError(
                f"Expected frames whose names admit one order in {ordered[0].parent}, got "
                f"{ordered[fault - 1].name} and {ordered[fault].name}; number them through with "
                "equally many digits, and keep one clip in a folder"
            )
    return ordered


def _numbers(stem: str) -> Sequence[int]:
    return [int(digits) for digits in re.findall(r"\d+", stem)]


def _decimals(stem: str) -> Sequence[Decimal]:
    return [Decimal(number) for number in re.findall(r"\d+(?:\.\d+)?", stem)]
