"""The layers of the package: a module imports only packages to its left."""

import ast
from pathlib import Path

import pytest

import eqs

ROOT = Path(eqs.__file__).parent
ORDER = [
    {"events"},
    {"frames", "representations", "drawing"},
    {"simulators"},
    {"scenes"},
    {"data"},
    {"models"},
    {"metrics"},
    {"training"},
    {"study"},
    {"pipelines"},
    {"commands"},
]
RANK = {name: rank for rank, names in enumerate(ORDER) for name in names}
MODULES = sorted(ROOT.glob("*/**/*.py"))


def imported_packages(source: str) -> set[str]:
    """First-level packages of eqs that a module's source imports."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return {name.split(".")[1] for name in names if name.startswith("eqs.")} & set(RANK)


def test_every_package_has_a_place() -> None:
    folders = {path.parent.name for path in ROOT.glob("*/__init__.py")}
    assert folders == set(RANK)


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_imports_run_downwards(path: Path) -> None:
    package = path.relative_to(ROOT).parts[0]
    above = {
        name
        for name in imported_packages(path.read_text())
        if name != package and RANK[name] >= RANK[package]
    }
    assert not above, f"eqs.{package} imports {above}, which stands to its right"


def test_an_upward_import_would_be_found() -> None:
    source = "from eqs.training import x\nimport eqs.models.rvt"
    assert imported_packages(source) == {"training", "models"}
