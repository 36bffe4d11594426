"""Optional packages: who lacks one is told how to get it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, requires

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
    # Libraries that check for optional ones themselves name them in words.
    found = re.search(r"(?:[Nn]o module named|Requirement) '([\w.]+)", str(error))
    name = error.name or (found[1] if found else extra)
    return (
        f"Expected the package {name} {purpose}, got none; type pip install "
        f"'{DISTRIBUTION}[{extra_with(name) or extra}]'"
    )


def extra_with(package: str) -> str | None:
    """The first extra that brings a package.

    Example:
        >>> extra_with("wandb"), extra_with("no_such_package")
        ('wandb', None)
    """
    try:
        listed = requires(DISTRIBUTION) or []
    except PackageNotFoundError:  # run from a folder, never installed
        return None
    for requirement in listed:
        found = re.match(r"([\w.-]+).*extra == [\"'](\w+)[\"']", requirement)
        if found and found[1].lower() == package.partition(".")[0].lower():
            return found[2]
    return None
