"""Workers end with the process that started them, however it ended."""

import os
import signal
import subprocess
import sys
import time

import pytest
from fault_harness import REPOSITORY, living

SOURCE = """
import os, sys, time
from pathlib import Path
from eqs.processors import side_by_side

def work(folder):
    Path(folder, str(os.getpid())).touch()
    time.sleep(120)

if __name__ == "__main__":
    list(side_by_side(work, [sys.argv[1]] * 2, 2))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="processes are listed in /proc")
def test_workers_end_with_a_killed_parent(tmp_path) -> None:
    script, began = tmp_path / "parent.py", tmp_path / "began"
    script.write_text(SOURCE)
    began.mkdir()
    parent = subprocess.Popen(
        [sys.executable, str(script), str(began)],
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        start_new_session=True,
    )
    try:
        wait_for(lambda: len(list(began.iterdir())) == 2)
        assert len(living(parent.pid)) >= 3
        parent.kill()
        parent.wait()
        wait_for(lambda: not living(parent.pid))
    finally:
        if living(parent.pid):
            os.killpg(parent.pid, signal.SIGKILL)


def wait_for(condition) -> None:
    for _ in range(400):
        if condition():
            return
        time.sleep(0.1)
    raise AssertionError("waited for 40 s")
