"""Files that are whole or not there, folders too, one writer at a time, hashes, whole numbers."""

from __future__ import annotations

import errno
import hashlib
import json
import logging
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
from filelock import FileLock, Timeout
from numpy.typing import NDArray

log = logging.getLogger(__name__)
PARTIAL = ".partial"
MADE_HERE = "event-quality-score"  # what pictures and films made here say of themselves
ABANDONED_S = 86_400  # nobody writes a day long without touching the file
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
# What HDF5 and PyTorch say where a disk is full; PyTorch sees only that a write was cut short.
SAID_WHEN_FULL = (
    "No space left on device", "File too large", "Disk quota exceeded",
    "unexpected pos", "PytorchStreamWriter failed writing",
)  # fmt: skip
WITHOUT_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP, errno.EINVAL)


@contextmanager
def complete_file(path: Path | str) -> Iterator[Path]:
    """Give a file its name only when it is complete, whoever else writes it at the same time.

    What the block writes to the path it is given is on the disk before it takes the name; after an
    exception nothing is left. Every writer has a temporary name of its own, so two of the same file
    do not meet, whether the file system knows locks or not.

    Args:
        path: the file's name; its folder is made if need be.

    Raises:
        OSError: the disk is full; the error names the file.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     with complete_file(Path(folder) / "note.txt") as partial:
        ...         _ = partial.write_text("all of it")
        ...     [file.name for file in Path(folder).iterdir()]
        ['note.txt']
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    _remove_abandoned(path)
    partial = path.with_name(f"{path.name}.{uuid4().hex}{PARTIAL}")
    try:
        with _named_when_full(path):
            yield partial
            with partial.open("rb+") as file:
                os.fsync(file.fileno())
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def is_full(error: BaseException) -> bool:
    """Whether an error says that there is no room to write; HDF5 and PyTorch say it in words."""
    if isinstance(error, OSError) and error.errno in FULL:
        return True
    in_words = isinstance(error, OSError | RuntimeError)
    return in_words and any(said in str(error) for said in SAID_WHEN_FULL)


@contextmanager
def _named_when_full(path: Path) -> Iterator[None]:
    """Name what a full disk keeps from being written, which libraries do not."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        if not is_full(error):
            raise
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path)) from error


@contextmanager
def complete_folder(path: Path | str) -> Iterator[Path]:
    """Give a folder its name only when all that the block writes into it is there.

    After an exception nothing is left.

    Args:
        path: the folder's name, which nothing may have yet.

    Raises:
        ValueError: there is something of that name.
        OSError: the disk is full; the error names the folder.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     with complete_folder(Path(folder) / "notes") as partial:
        ...         _ = (partial / "a.txt").write_text("all of it")
        ...     [file.name for file in Path(folder).rglob("*.txt")]
        ['a.txt']
    """
    path = Path(path)
    if path.exists():
        raise ValueError(f"Expected nothing at {path}, got something; name another place")
    partial = path.with_name(f"{path.name}.{uuid4().hex}{PARTIAL}")
    partial.mkdir(parents=True)
    try:
        with _named_when_full(path):
            yield partial
        partial.rename(path)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _remove_abandoned(path: Path) -> None:
    """Remove what writers of this file that were killed long ago have left."""
    for other in path.parent.glob(f"{glob_escaped(path.name)}.*{PARTIAL}"):
        try:
            if other.is_file() and time.time() - other.stat().st_mtime > ABANDONED_S:
                other.unlink()
        except OSError:  # another process removes it, or it is not ours to remove
            continue


def glob_escaped(name: str) -> str:
    """A name as a pattern that finds itself alone."""
    return "".join(f"[{letter}]" if letter in "*?[" else letter for letter in name)


def remove_unfinished(folder: Path, pattern: str) -> None:
    """Remove the partial folders that killed writers left; only for who works here alone."""
    for left in folder.glob(f"{pattern}{PARTIAL}"):
        shutil.rmtree(left, ignore_errors=True)


@contextmanager
def one_at_a_time(path: Path | str, work: str) -> Iterator[bool]:
    """Let one process at a time do some work; the others wait and then find it done.

    Where the file system has no locks all of them work, after a warning; the files they write are
    whole all the same. The block is told whether it works alone.

    Args:
        path: what is worked on; the lock is a hidden file beside it.
        work: what is done, for those who wait.

    Raises:
        OSError: the lock cannot be made, for any other reason.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    lock = FileLock(path.with_name(f".{path.name}.lock"))
    try:
        lock.acquire(timeout=0)
    except Timeout:
        log.info("another process is %s; waiting for it", work)
        lock.acquire()
    except (NotImplementedError, OSError) as error:
        if isinstance(error, OSError) and error.errno not in WITHOUT_LOCKS:
            raise
        log.warning("no locks at %s (%s); start one command at a time there", path, error)
    try:
        yield lock.is_locked
    finally:
        lock.release()


def refuse_foreign(path: Path | str) -> None:
    """Let nobody lose a picture or film that does not say that it was made here.

    Raises:
        ValueError: there is such a file.
    """
    path = Path(path)
    if path.exists() and not (path.is_file() and MADE_HERE.encode() in path.read_bytes()):
        raise ValueError(
            f"Expected no other file at {path}, got one that was not made here; name another "
            "place, or remove it"
        )


def write_text(text: str, path: Path) -> Path:
    """Write text under its name only when it is complete."""
    with complete_file(path) as partial:
        partial.write_text(text, encoding="utf-8")
    return path


def write_json(path: Path, content: object) -> None:
    """Write a record under its name only when it is complete."""
    write_text(json.dumps(content, indent=2) + "\n", path)


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
