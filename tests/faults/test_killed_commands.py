"""Commands that are killed, or started twice at once, leave what an undisturbed one leaves."""

import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from fault_harness import Count, Fault, Phase, kill_and_repeat, moments, pair, prepared, reference
from fault_phases import PHASES, SIMULATE

# `make faults` tries every phase many times; the whole suite one phase, to keep this code alive.
KILLS = int(os.environ.get("EQS_FAULT_KILLS", "0"))
PAIRS = int(os.environ.get("EQS_FAULT_PAIRS", "0"))
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="processes are listed in /proc"),
]


def of_phases(many: int) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("phase", PHASES if many else [SIMULATE], ids=lambda p: p.name)


@of_phases(KILLS)
def test_a_killed_command_is_typed_again(phase: Phase, tmp_path: Path, capsys) -> None:
    def kills(seconds: float) -> list[Fault]:
        return [
            lambda base, folder, wanted, at=at: kill_and_repeat(phase, base, folder, at, wanted)
            for at in moments(phase, seconds, KILLS or 2)
        ]

    tried("killed", phase, tmp_path, kills, capsys)


@of_phases(PAIRS)
def test_two_of_a_command_at_once(phase: Phase, tmp_path: Path, capsys) -> None:
    def pairs(_: float) -> list[Fault]:
        return [lambda base, folder, wanted: pair(phase, base, folder, wanted)] * (PAIRS or 1)

    tried("two at once", phase, tmp_path, pairs, capsys)


def tried(
    what: str, phase: Phase, place: Path, faults: Callable[[float], list[Fault]], capsys
) -> None:
    """Disturb a command in several ways, say what came of it, and allow no fault."""
    count, base = Count(), prepared(phase, place / "base")
    # Everything in one folder of one name: paths stand in hashes of what was done there.
    wanted, seconds = reference(phase, base, place / "here")
    (place / "here").rename(place / "undisturbed")
    for fault in faults(seconds):
        count.add(fault(base, place / "here", wanted))
        with capsys.disabled():  # for who waits
            sys.stdout.write(f"\n{what} {phase.name}: {count}")
            sys.stdout.flush()
    assert not count.faults, "\n".join(count.faults)
