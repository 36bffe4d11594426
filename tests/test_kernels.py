"""Compiled loops are kept between runs, but not when what they call has changed."""

import subprocess
import sys
import textwrap

import pytest

from eqs import kernels

INNER = """
from {package} import njit
@njit(cache=True)
def inner(value):
    return value {operation} 1
"""
OUTER = """
from {package} import njit
from inner import inner
@njit(cache=True)
def outer(value):
    return 10 * inner(value)
"""


def run(folder):
    """What a program prints that uses both modules, in a process of its own."""
    program = f"""
        import sys
        sys.path.insert(0, {str(folder)!r})
        from pathlib import Path
        from eqs import kernels
        kernels.ROOT = Path({str(folder)!r})
        from outer import outer
        print(outer(5))
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)], capture_output=True, text=True, check=True
    )
    return int(done.stdout)


@pytest.mark.parametrize(("package", "after"), [("numba", 60), ("eqs.kernels", 40)])
def test_a_loop_knows_of_a_helper_in_another_file(tmp_path, package, after):
    """By numba's own cache, which looks at the loop's file alone, the old helper goes on."""
    (tmp_path / "outer.py").write_text(OUTER.format(package=package))
    (tmp_path / "inner.py").write_text(INNER.format(package=package, operation="+"))
    assert run(tmp_path) == 60
    (tmp_path / "inner.py").write_text(INNER.format(package=package, operation="-  "))
    assert run(tmp_path) == after


def test_what_nobody_used_for_long_is_cleared_away(tmp_path, monkeypatch):
    import os

    monkeypatch.setattr(kernels, "ROOT", tmp_path)
    base = tmp_path / "__pycache__"
    for name in ("kernels-old", "kernels-new", "other"):
        (base / name).mkdir(parents=True)
    os.utime(base / "kernels-old", (0, 0))
    os.utime(base / "other", (0, 0))
    kernels.cache_folder.cache_clear()
    try:
        found = kernels.cache_folder()
        chosen = kernels.cache_folder(str(tmp_path / "mine"))
    finally:
        kernels.cache_folder.cache_clear()
    assert {path.name for path in base.iterdir()} == {found.name, "kernels-new", "other"}
    assert chosen.parent == tmp_path / "mine"


def test_a_folder_that_is_not_ours_is_left_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(kernels, "ROOT", tmp_path / "file")
    (tmp_path / "file").write_text("no folder")
    kernels.cache_folder.cache_clear()
    try:
        assert kernels.cache_folder().name.startswith("kernels-")
    finally:
        kernels.cache_folder.cache_clear()
