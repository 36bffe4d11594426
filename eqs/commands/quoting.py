"""Paths as they are typed, quoted for Hydra, whose grammar knows fewer letters than disks do."""

from __future__ import annotations

import re
from pathlib import Path

PLAIN = re.compile(r"[A-Za-z0-9_./:+@%?|*-]*")  # what Hydra reads as it stands, without a break
QUOTES = ("'", '"')


def with_quoted_path(argument: str) -> str:
    """An override whose value is a path that is there, or could be, with the value in quotes.

    Convention: a value is a path if something has this very name, or if it has a folder that is
    there; every other value is Hydra's to read, commas of a sweep included.

    Example:
        >>> with_quoted_path("out=./a (copy), b.h5")
        "out='./a (copy), b.h5'"
        >>> with_quoted_path("sim=esim,v2e")
        'sim=esim,v2e'
    """
    key, equals, value = argument.partition("=")
    if not equals or value.startswith(QUOTES) or PLAIN.fullmatch(value):
        return argument
    return f"{key}={quoted(value)}" if is_path(value) else argument


def is_path(value: str) -> bool:
    """Whether something has this name, or the folder is there in which something could."""
    try:
        path = Path(value)
        return path.exists() or ("/" in value and path.parent.is_dir())
    except (OSError, ValueError):  # longer than names may be, or with a zero byte
        return False


def quoted(value: str) -> str:
    r"""A text that Hydra reads as it stands.

    Source: Hydra's grammar of overrides: in quotes only a quote, and backslashes before one or at
    the end, are escaped.

    Example:
        >>> print(quoted("it's"))
        'it\'s'
    """
    escaped = re.sub(r"(\\*)'", lambda found: found[1] * 2 + r"\'", value)
    return "'" + re.sub(r"(\\+)$", lambda found: found[1] * 2, escaped) + "'"
