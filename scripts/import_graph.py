"""Print which rooms of the package import which, and the circles among modules if there are any."""

from __future__ import annotations

import ast
import functools
import graphlib
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1] / "eqs"


@functools.cache
def modules(root: Path = ROOT) -> dict[str, Path]:
    """Every module of the package by its dotted name."""
    found = {}
    for path in sorted(root.rglob("*.py")):
        parts = path.relative_to(root.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imports(source: str, known: set[str], *, at_once: bool = False) -> set[str]:
    """Modules of the package that a module's source imports.

    Args:
        source: the module's text.
        known: names of the package's modules; of others nothing is said.
        at_once: only what is imported when the module is, not what a function or a type checker
            needs later.
    """
    found: set[str] = set()
    waiting: list[ast.AST] = [ast.parse(source)]
    while waiting:
        node = waiting.pop()
        if at_once and (isinstance(node, ast.FunctionDef) or _for_types(node)):
            continue
        if isinstance(node, ast.Import):
            found |= {_longest(alias.name, known) for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {_longest(f"{node.module}.{alias.name}", known) for alias in node.names}
        waiting.extend(ast.iter_child_nodes(node))
    return found - {""}


def _for_types(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)


def _longest(name: str, known: set[str]) -> str:
    """The module that a dotted name lies in; empty where it is none of the package's."""
    while name and name not in known:
        name = name.rpartition(".")[0]
    return name


@functools.cache
def graph(*, at_once: bool = False) -> dict[str, set[str]]:
    """What each module imports."""
    known = modules()
    return {
        name: imports(path.read_text(), set(known), at_once=at_once) - {name}
        for name, path in known.items()
    }


def circle(edges: dict[str, set[str]]) -> list[str]:
    """Modules that need each other before either is whole; none is a good answer.

    A package is whole once its `__init__` has run, so whoever imports a part of it from outside
    needs all of it; its own parts do not.
    """
    needed = {
        name: {
            *imported,
            *(
                above
                for each in imported
                for above in _packages(each)
                if not f"{name}.".startswith(f"{above}.") and above in edges
            ),
        }
        for name, imported in edges.items()
    }
    try:
        graphlib.TopologicalSorter(needed).prepare()
    except graphlib.CycleError as error:
        return list(error.args[1])
    return []


def _packages(name: str) -> list[str]:
    parts = name.split(".")
    return [".".join(parts[:depth]) for depth in range(1, len(parts))]


def room(name: str) -> str:
    """The folder of a module, or the module itself where it lies at the top."""
    path = modules()[name]
    folder = path.parent.relative_to(ROOT.parent).parts
    return ".".join(folder) if len(folder) > 1 else name


def main() -> None:
    """Print a line for each room, then the circle or that there is none."""
    rooms: dict[str, set[str]] = {}
    for name, imported in graph().items():
        rooms.setdefault(room(name), set()).update(room(each) for each in imported)
    for name, others in sorted(rooms.items()):
        sys.stdout.write(f"{name:<32} {', '.join(sorted(others - {name})) or '-'}\n")
    found = circle(graph(at_once=True))
    sys.stdout.write(f"circle: {' > '.join(found)}\n" if found else "no circles\n")


if __name__ == "__main__":
    main()
