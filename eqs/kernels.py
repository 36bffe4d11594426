"""Compiled loops, kept between runs for as long as no source of the package changes.

Numba keeps what it compiled beside each file, and looks at that file alone: a loop whose helper in
another file has changed goes on with the old helper. Here all sources count.
"""

from __future__ import annotations

import hashlib
import shutil
import tempfile
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, Literal, TypeVar, cast

import numba
from numba.core import config

Function = TypeVar("Function", bound=Callable[..., Any])

CHOICE = "CACHE_DIR"  # of numba's settings, read where a loop is declared
ROOT = Path(__file__).parent
UNUSED_S = 14 * 86_400  # after which the loops of other sources are cleared away


def njit(
    *, cache: bool = False, nogil: bool = False, error_model: Literal["python", "numpy"] = "python"
) -> Callable[[Function], Function]:
    """As `numba.njit`, with a cache that knows all sources of the package.

    Example:
        >>> @njit(nogil=True)
        ... def twice(value):
        ...     return 2 * value
        >>> twice(21)
        42
    """

    def compiled(function: Function) -> Function:
        before = getattr(config, CHOICE)
        setattr(config, CHOICE, str(cache_folder(before)))
        try:
            made: Any = numba.njit(cache=cache, nogil=nogil, error_model=error_model)(function)
            return cast("Function", made)
        finally:
            setattr(config, CHOICE, before)

    return compiled


@cache
def cache_folder(chosen: str = "") -> Path:
    """Where compiled loops of these very sources are kept.

    Args:
        chosen: the folder that the user gave numba, if any.
    """
    for base in (Path(chosen) if chosen else ROOT / "__pycache__", Path(tempfile.gettempdir())):
        folder = base / f"kernels-{sources_hash()}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            folder.touch()
        except OSError:  # an installation that is not ours to write to
            continue
        _clear(base, folder)
        return folder
    return ROOT


def sources_hash() -> str:
    """Changes whenever a source of the package does."""
    seen = hashlib.blake2b(digest_size=6)
    for path in sorted(ROOT.rglob("*.py")):
        found = path.stat()
        seen.update(f"{path.relative_to(ROOT)} {found.st_size} {found.st_mtime_ns}\n".encode())
    return seen.hexdigest()


def _clear(base: Path, kept: Path) -> None:
    """Clear away what nobody used for long."""
    for other in base.glob("kernels-*"):
        if other != kept and time.time() - other.stat().st_mtime > UNUSED_S:
            shutil.rmtree(other, ignore_errors=True)
