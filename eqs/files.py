"""Small files that are whole or not there: JSON records and hashes of what they describe."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any


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
