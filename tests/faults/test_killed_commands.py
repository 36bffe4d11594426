"""Commands that are killed, or started twice at once, leave what an undisturbed one leaves."""

import os
import sys
from pathlib import Path

import pytest
from fault_harness import Count, kill_and_repeat, moments, pair, prepared, reference
from fault_phases import PHASES, SIMULATE

# `make faults` tries every phase many times; the whole suite one phase twice.
KILLS = int(os.environ.get("EQS_FAULT_KILLS", "0"))
PAIRS = int(os.environ.get("EQS_FAULT_PAIRS", "0"))
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="processes are listed in /proc"),
]


def chosen(phase, many, few):
    if many:
        return many
    if phase is not SIMULATE:
        pytest.skip("tried by make faults")
    return few


def tell(what, phase, count, capsys):
    with capsys.disabled():
        pass


@pytest.mark.parametrize("phase", PHASES, ids=lambda phase: phase.name)
def test_a_killed_command_is_typed_again(phase, tmp_path: Path, capsys) -> None:
    count, tries = Count(), chosen(phase, KILLS, 2)
    base = prepared(phase, tmp_path / "base")
    # Everything in one folder of one name: paths stand in hashes of what was done there.
    wanted, seconds = reference(phase, base, tmp_path / "here")
    (tmp_path / "here").rename(tmp_path / "undisturbed")
    for moment_s in moments(phase, seconds, tries):
        count.add(kill_and_repeat(phase, base, tmp_path / "here", moment_s, wanted))
    tell("killed", phase, count, capsys)
    assert not count.faults, "\n".join(count.faults)


@pytest.mark.parametrize("phase", PHASES, ids=lambda phase: phase.name)
def test_two_of_a_command_at_once(phase, tmp_path: Path, capsys) -> None:
    count, tries = Count(), chosen(phase, PAIRS, 1)
    base = prepared(phase, tmp_path / "base")
    wanted, _ = reference(phase, base, tmp_path / "here")
    (tmp_path / "here").rename(tmp_path / "undisturbed")
    for _ in range(tries):
        count.add(pair(phase, base, tmp_path / "here", wanted))
    tell("two at once", phase, count, capsys)
    assert not count.faults, "\n".join(count.faults)
