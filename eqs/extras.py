"""Optional packages: who lacks one is told how to get it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

DISTRIBUTION = "event-quality-score"


@contextmanager
def needed(extra: str, purpose: str) -> Iterator[None]:
    """Explain that an import in the block failed for want of an optional package.

    Args:
        extra: the extra that brings it.
        purpose: what it is for.

    Raises:
        ValueError: a package outside this one is missing.

    Example:
        >>> with needed("video", "to decode films"):  # doctest: +ELLIPSIS
        ...     import no_such_package
        Traceback (most recent call last):
        ValueError: Expected the package no_such_package to decode films, got none; type ...
    """
    try:
        yield
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] == "eqs":
            raise
        raise ValueError(lacking(error, extra, purpose)) from error


def lacking(error: ModuleNotFoundError, extra: str, purpose: str) -> str:
    """The sentence about a missing package."""
    found = re.search(r"[Nn]o module named '([\w.]+)'", str(error))
    name = error.name or (found[1] if found else extra)
    return (
        f"Expected the package {name} {purpose}, got none; type pip install "
        f"'{DISTRIBUTION}[{extra}]'"
    )
