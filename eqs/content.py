"""Hashes of what files hold, remembered between commands so that large data sets are read once."""

from __future__ import annotations

import hashlib
import os
import sqlite3
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

from eqs.processors import available_cores

# A file that changed a moment ago may change again without a trace: clocks of files are coarse.
SETTLED_NS = 2_000_000_000
ASKED_AT_ONCE = 500
Stamp = tuple[int, int, int, int]


def content_hashes(paths: Iterable[Path | str]) -> list[str]:
    """A hash of the bytes of each file, as 32 hex digits.

    A hash is remembered in the user's cache folder and taken from there while the file's place,
    size and times are the same. Where that folder cannot be written the files are read every time.

    Raises:
        FileNotFoundError: one of the files does not exist.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     one, other = Path(folder) / "one", Path(folder) / "other"
        ...     _ = one.write_text("same"), other.write_text("same")
        ...     len(set(content_hashes([one, other])))
        1
    """
    files = [Path(path).resolve() for path in paths]
    stamps = {str(file): _stamp(file) for file in files}
    known = _remembered(list(stamps))
    hashes = {path: known[path][1] for path in known if known[path][0] == stamps[path]}
    unknown = [path for path in stamps if path not in hashes]
    if unknown:
        with ThreadPoolExecutor(available_cores()) as pool:
            hashes |= dict(zip(unknown, pool.map(_digest, unknown), strict=True))
        _remember({path: (stamps[path], hashes[path]) for path in unknown})
    return [hashes[str(file)] for file in files]


def content_hash(path: Path | str) -> str:
    """A hash of the bytes of one file, see `content_hashes`."""
    return content_hashes([path])[0]


def _digest(path: str) -> str:
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()


def _stamp(path: Path) -> Stamp:
    found = path.stat()
    # The time of the last change of any kind also tells of bytes whose old time was put back.
    inode = found.st_ino & (2**63 - 1)  # what the memory can hold
    return found.st_size, found.st_mtime_ns, found.st_ctime_ns, inode


def _memory() -> Path:
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return cache / "event-quality-score" / "content.sqlite"


def _opened() -> sqlite3.Connection:
    memory = _memory()
    memory.parent.mkdir(parents=True, exist_ok=True)
    connection = sqlite3.connect(memory, timeout=30)
    connection.execute(
        "CREATE TABLE IF NOT EXISTS files (path TEXT PRIMARY KEY, size INTEGER, mtime INTEGER, "
        "ctime INTEGER, inode INTEGER, hash TEXT)"
    )
    return connection


def _remembered(paths: Sequence[str]) -> dict[str, tuple[Stamp, str]]:
    found: dict[str, tuple[Stamp, str]] = {}
    try:
        with closing(_opened()) as connection:
            for first in range(0, len(paths), ASKED_AT_ONCE):
                asked = paths[first : first + ASKED_AT_ONCE]
                marks = ",".join("?" * len(asked))
                rows = connection.execute(f"SELECT * FROM files WHERE path IN ({marks})", asked)
                found |= {path: (tuple(stamp), digest) for path, *stamp, digest in rows}
    except (sqlite3.Error, OSError):  # no memory costs time, never a result
        return {}
    return found


def _remember(hashed: dict[str, tuple[Stamp, str]]) -> None:
    now = time.time_ns()
    settled = [
        (path, *stamp, digest)
        for path, (stamp, digest) in hashed.items()
        if now - max(stamp[1], stamp[2]) > SETTLED_NS
    ]
    try:
        with closing(_opened()) as connection, connection:
            connection.executemany("INSERT OR REPLACE INTO files VALUES (?,?,?,?,?,?)", settled)
    except (sqlite3.Error, OSError):
        return
