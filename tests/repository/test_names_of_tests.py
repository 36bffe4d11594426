"""Test modules are told apart by their names alone."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def test_no_two_test_modules_share_a_name() -> None:
    """Two of one name cannot be collected in one run, though each can by itself."""
    counted = Counter(path.name for path in ROOT.rglob("test_*.py"))
    assert [name for name, count in counted.items() if count > 1] == []
