"""Damaged files of every format end in a sentence or in events that are valid.

A case may neither raise another exception, nor end or hang the interpreter, nor take more memory
than twice the file and a constant. `fuzz.py` damages and reads the files in a process of its own.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from event_files import WRITERS

HERE = Path(__file__).parent
CASES, MANY = 20, 500
LONGEST_S = 240  # of all cases together, each of which has a limit of its own


def run(folder, cases, names):
    """How the cases ended, by format, and what was printed last."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([*map(str, sys.path)])}
    command = [sys.executable, str(HERE / "fuzz.py"), str(folder), str(cases), *names]
    done = subprocess.run(
        command, capture_output=True, env=environment, timeout=LONGEST_S, check=False
    )
    lines = done.stdout.decode("utf-8", "replace").splitlines()
    ended = {name: [] for name in names}
    for case, outcome in zip(lines[::2], lines[1::2], strict=False):
        ended[case.split()[0]].append((case, outcome))
    return ended, done.returncode, f"{lines[-1:]} {done.stderr.decode()[-2000:]}"


def check(ended, code, last, cases):
    faults = [pair for pairs in ended.values() for pair in pairs if "FAULT" in pair[1]]
    assert faults == []
    assert code == 0, last
    for name, pairs in ended.items():
        assert len(pairs) == cases, name
        # Some damage is not noticed and some is, or nothing was tested.
        assert any(outcome.startswith("refused") for _, outcome in pairs), name


def test_damaged_files_of_every_format(tmp_path):
    ended, code, last = run(tmp_path, CASES, [*WRITERS])
    check(ended, code, last, CASES)
    found = sum(outcome.startswith("events") for pairs in ended.values() for _, outcome in pairs)
    assert found > len(WRITERS)


@pytest.mark.slow
@pytest.mark.skipif("EQS_SLOW" not in os.environ, reason="takes minutes; set EQS_SLOW=1")
def test_many_damaged_files_of_every_format(tmp_path):
    check(*run(tmp_path, MANY, [*WRITERS]), MANY)


def test_a_fault_is_found():
    with pytest.raises(AssertionError):
        check({"a": [("a 0", "FAULT KeyError")]}, 0, "", 1)
    with pytest.raises(AssertionError):
        check({"a": [("a 0", "refused Expected")]}, -6, "", 1)
