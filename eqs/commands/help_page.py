"""The page that `--help` prints, from the comments of the configuration files.

It reads text and imports nothing, so that it is there at once.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

CONFIGS = Path(__file__).parents[1] / "configs"
MORE = (
    "KEY=VALUE changes any single value, as sim.threshold_on_log=0.3; --cfg job prints them all,\n"
    "-m runs a sweep, --hydra-help shows what else Hydra can do.\n"
)
GROUP = re.compile(r"  - (?P<group>[\w@.]+): (?P<default>\S+) +# (?P<line>.+)")
KEY = re.compile(r"(?P<key>\w+): (?P<default>.*)")


class Group(NamedTuple):
    """A group of options with its default and what it is about."""

    name: str
    default: str
    line: str


def purpose(config: str) -> str:
    """The first sentence of a command's configuration."""
    return _lines(CONFIGS / f"{config}.yaml")[0].removeprefix("# ")


def configured_page(config: str, shown: str) -> str:
    """The help of a command that Hydra configures.

    Args:
        config: name of its configuration.
        shown: how the command is typed.
    """
    sections = [purpose(config), "", *_examples(config, shown)]
    for group in groups(config):
        sections += ["", f"{group.name}={group.default}   {group.line}"]
        names = options(group.name)
        width = max(map(len, names), default=0) + 2
        sections += [f"  {name:<{width}}{first_comment(path)}" for name, path in names.items()]
    sections += ["", "Single values"]
    for key, default, comment in keys(config):
        sections += [f"  {key}={default}", f"      {comment}"]
    return "\n".join([*sections, "", MORE])


def groups(config: str) -> list[Group]:
    """The groups that a command's users choose from: those that say what they are about."""
    found: dict[str, Group] = {}
    for each in _ancestry(config):
        for line in _lines(CONFIGS / f"{each}.yaml"):
            match = GROUP.fullmatch(line)
            if match:
                found[match["group"]] = Group(*match.groups())
    return list(found.values())


def options(group: str) -> dict[str, Path]:
    """The options of a group and, after each, its settings, by how they are chosen."""
    folder = CONFIGS / group
    paths = sorted(path.relative_to(folder).with_suffix("") for path in folder.rglob("*.yaml"))
    return {path.as_posix(): folder / f"{path}.yaml" for path in paths}


def keys(config: str) -> Iterator[tuple[str, str, str]]:
    """A command's own values with their defaults and comments, those of what it builds on last."""
    seen: set[str] = set()
    for each in reversed(_ancestry(config)):
        comment: list[str] = []
        for line in _own_lines(each):
            match = KEY.fullmatch(line)
            if match and comment and match["key"] not in seen:
                seen.add(match["key"])
                yield match["key"], match["default"] or "...", " ".join(comment)
            comment = [*comment, line.removeprefix("# ")] if line.startswith("# ") else []


def first_comment(path: Path) -> str:
    """What an option is, in its file's first comment."""
    for line in _lines(path):
        if line.startswith("# ") and not line.startswith("# @"):
            return line.removeprefix("# ")
    return ""


def _examples(config: str, shown: str) -> list[str]:
    verb = f"#   {config} "
    lines = [line for line in _lines(CONFIGS / f"{config}.yaml") if line.startswith(verb)]
    split = [line.removeprefix(verb).split("  ", 1) for line in lines]
    width = max((len(typed) for typed, *_ in split), default=0) + 3
    return [f"  {shown} {typed:<{width}}{''.join(said).strip()}" for typed, *said in split]


def _ancestry(config: str) -> list[str]:
    """A command's configuration after that which it builds on."""
    text = (CONFIGS / f"{config}.yaml").read_text(encoding="utf-8")
    parents = re.findall(r"^  - (\w+)$", text.partition("defaults:")[2], re.MULTILINE)
    return [*(above for p in parents if p != "_self_" for above in _ancestry(p)), config]


def _own_lines(config: str) -> list[str]:
    """The lines after the defaults and what Hydra itself is told."""
    text = "\n".join(_lines(CONFIGS / f"{config}.yaml"))
    return text.partition("\nhydra:")[2].partition("\n\n")[2].splitlines()


def _lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines()
