"""The definition's hash and its refusals."""

from dataclasses import fields, replace

import pytest

from eqs.metrics import Definition
from eqs.metrics.definition import FIXED_RULES

OTHER = {
    "tap": "gate",
    "features": "centred",
    "distance": "cosine",
    "stages": (1, 2),
    "patch": "grid",
    "patch_size": 2,
    "pooling": "smooth",
    "state": "reset",
    "mask": "active",
    "bins": 5,
    "window_us": 40_000,
    "count_cutoff": 8,
    "span": "events",
    "counts": "normalised",
    "warmup_windows": 10,
    "architecture": "other",
}


def test_every_choice_changes_the_hash():
    base = Definition()
    hashes = {base.hash} | {replace(base, **{key: value}).hash for key, value in OTHER.items()}
    assert OTHER.keys() == {field.name for field in fields(Definition)}
    assert len(hashes) == len(OTHER) + 1


def test_hash_is_short_and_repeats():
    assert Definition().hash == Definition().hash
    assert len(Definition().hash) == 12


def test_no_fixed_rule_hides_a_choice():
    assert FIXED_RULES.keys().isdisjoint(field.name for field in fields(Definition))


def test_fixed_rules_are_part_of_the_hash(monkeypatch):
    before = Definition().hash
    monkeypatch.setitem(FIXED_RULES, "version", "another")
    assert Definition().hash != before


@pytest.mark.parametrize(("windows", "warmup"), [(1, 0), (3, 0), (9, 2), (40, 10), (400, 20)])
def test_warmup_is_at_most_a_quarter(windows, warmup):
    assert Definition().warmup_of(windows) == warmup


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"stages": ()}, "stages counted from 1"),
        ({"stages": (2, 1)}, "stages counted from 1"),
        ({"stages": (0, 1)}, "stages counted from 1"),
        ({"stages": ("a", "b")}, r"stages as whole numbers, got \('a', 'b'\); set eqs.stages"),
        (
            {"patch_size": "three"},
            "patch_size to be a whole number .*got 'three'; set eqs.patch_size",
        ),
        ({"features": "white"}, "features raw or silence or centred or whitened, got 'white'"),
        ({"counts": "none"}, "counts raw or normalised, got 'none'; set eqs.counts"),
        ({"span": "all"}, "span window or events"),
        ({"patch": "hex"}, "patch cells or grid, got 'hex'; set eqs.patch"),
        ({"pooling": "max"}, "pooling box or smooth, got 'max'; set eqs.pooling"),
        ({"state": "kept"}, "state carried or reset"),
        ({"mask": True}, "mask none or active, got True"),
        (
            {"window_us": 0},
            "window_us to be a whole number of at least 1, got 0; set eqs.window_us",
        ),
        ({"warmup_windows": -1}, "whole number of at least 0, got -1; set eqs.warmup_windows"),
    ],
)
def test_impossible_choices_are_refused(choice, message):
    with pytest.raises(ValueError, match=message):
        Definition(**choice)
