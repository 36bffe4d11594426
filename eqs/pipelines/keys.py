"""Keys of a configuration: which exist, and which may have been meant."""

from __future__ import annotations

import difflib
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from omegaconf import Container, DictConfig, OmegaConf
from omegaconf.errors import ConfigAttributeError, ConfigKeyError

CONFIGS = Path(__file__).parents[1] / "configs"
MOST = 3


@contextmanager
def keys_explained(typed: Sequence[str] = ()) -> Iterator[None]:
    """Add to Hydra's complaint about a key that does not exist those that may have been meant.

    Args:
        typed: the arguments, whose values may name an option.
    """
    try:
        yield
    except SystemExit as stop:
        cause = getattr(stop.__context__, "__cause__", None)
        if isinstance(cause, ConfigAttributeError | ConfigKeyError):
            sys.stderr.write(existing_keys(cause, typed) + "\n")
        raise


def existing_keys(error: ConfigAttributeError | ConfigKeyError, typed: Sequence[str] = ()) -> str:
    """What could have been written in place of a key that does not exist."""
    full, parent = str(error.full_key), error.parent_node
    place, _, key = full.rpartition(".")
    siblings = [name for name in parent or () if not str(name).startswith("_")]
    root = parent._get_root() if isinstance(parent, Container) else parent
    leaves = [leaf for leaf in leaf_keys(root) if leaf != full]
    meant = shallowest([leaf for leaf in leaves if leaf.rpartition(".")[2] == key])
    meant = meant or options_named([each for each in typed if each.startswith(f"{full}=")])
    if not meant:
        near = difflib.get_close_matches(key, map(str, siblings), n=MOST)
        meant = [f"{place}.{name}" if place else name for name in near]
    if not meant:
        names = {leaf.rpartition(".")[2] for leaf in leaves}
        near = difflib.get_close_matches(key, sorted(names), n=1, cutoff=0.8)
        meant = shallowest([leaf for leaf in leaves if leaf.rpartition(".")[2] in near])
    if not meant:
        meant = [f"{place}.{name}" if place else str(name) for name in sorted(map(str, siblings))]
    return f"Expected a key that exists, got {full}; set {', '.join(meant)}"


def in_this_command(message: str, cfg: DictConfig, where: str = "") -> str:
    """A sentence whose advice names keys that the typed command has.

    What is deep inside does not know the command: a simulator says `set sim.mode`, which
    `evaluate` calls `simulators.esim.mode`.

    Args:
        message: a sentence that may end in `; set KEY or KEY`.
        cfg: the command's configuration.
        where: key of the part that complained, if known.
    """
    said, found, advice = message.rpartition("; set ")

    def known(match: re.Match[str]) -> str:
        key, name = match[0], match[0].rpartition(".")[2]
        if exists(cfg, key):
            return key
        if where and exists(cfg, f"{where}.{name}"):
            return f"{where}.{name}"
        others = [leaf for leaf in leaf_keys(cfg) if leaf.rpartition(".")[2] == name]
        return " or ".join(shallowest(others)) or key

    return said + found + re.sub(r"\b[a-z_]+(?:\.[a-z_]+)+\b", known, advice)


def exists(cfg: DictConfig, key: str) -> bool:
    """Whether a configuration has a key, with a value or without."""
    place, _, name = key.rpartition(".")
    parent = OmegaConf.select(cfg, place) if place else cfg
    return isinstance(parent, DictConfig) and not parent._is_none() and name in parent


def leaf_keys(root: object) -> list[str]:
    """Every key that holds a value of its own, not one that follows another key."""
    found: list[str] = []

    def walk(node: DictConfig, path: str) -> None:
        for name in map(str, node):
            where = f"{path}.{name}" if path else name
            if OmegaConf.is_interpolation(node, name) or name.startswith("_"):
                continue
            inner = node._get_node(name)
            if isinstance(inner, DictConfig) and not inner._is_none():
                walk(inner, where)
            else:
                found.append(where)

    if isinstance(root, DictConfig):
        walk(root, "")
    return found


def shallowest(keys: Sequence[str]) -> list[str]:
    """The keys that lie least deep, a few of them."""
    depth = min((key.count(".") for key in keys), default=0)
    return [key for key in keys if key.count(".") == depth][:MOST]


def options_named(typed: Sequence[str]) -> list[str]:
    """Options of groups that are called as a value that was typed, as they are chosen."""
    found = []
    for argument in typed:
        value = argument.partition("=")[2]
        for path in sorted(CONFIGS.glob(f"*/*/{value}.yaml") if value.isidentifier() else ()):
            group, *option = path.relative_to(CONFIGS).with_suffix("").parts
            found.append(f"{group}={'/'.join(option)}")
    return found[:MOST]
