"""Small files: JSON records that are whole or not there, hashes, lists of whole numbers."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


def write_json(path: Path, content: object) -> None:
    """Write a record under its name only when it is complete."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".partial")
    partial.write_text(json.dumps(content, indent=2) + "\n")
    partial.replace(path)


def read_json(path: Path) -> dict[str, Any]:
    """Read a record.

    Raises:
        ValueError: the file does not hold a JSON object.
    """
    try:
        content = json.loads(path.read_text())
    except json.JSONDecodeError as error:
        raise ValueError(f"Expected a JSON object in {path}, got: {error}; delete it") from error
    if not isinstance(content, dict):
        raise ValueError(f"Expected a JSON object in {path}, got a {type(content).__name__}")
    return content


def short_hash(content: object) -> str:
    """Eight hex digits that change with any value of a JSON-able description.

    Example:
        >>> short_hash({"a": 1, "b": 2}) == short_hash({"b": 2, "a": 1})
        True
    """
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(canonical.encode()).hexdigest()[:8]


def file_sha256(path: Path) -> str:
    """Digest of a file's content, as 64 hex digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def whole_numbers(path: Path) -> NDArray[np.int64]:
    """The numbers of a text file, one row per line that is not a comment.

    Raises:
        ValueError: the file holds something else, or rows of different lengths.
    """
    try:
        lines = [line for line in path.read_text().splitlines() if line.strip()]
        rows = [line.split(",") for line in lines if not line.lstrip().startswith("#")]
        return np.array([[int(number) for number in row] for row in rows], np.int64)
    except (ValueError, OverflowError) as error:  # no text, no number, too large, or rows uneven
        raise ValueError(
            f"Expected whole microseconds in {path}, got a file that says otherwise ({error}); "
            "write one row a line"
        ) from error
