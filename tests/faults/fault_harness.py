"""Commands on the smallest data there are, killed and typed again."""

from __future__ import annotations

import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from eqs.events import EventReader

REPOSITORY = Path(__file__).resolve().parents[2]
SMALL = [
    "experiment=smoke",
    "data.size=32x32",
    "data.generator.frames=5",
    "data.generator.sequences={train: 1, val: 1, test: 1}",
    "+data.generator.workers=1",
    "protocol.min_side_px=0",
    "protocol.min_diagonal_px=0",
]
RECIPE = ["recipe.steps_per_epoch=4", "recipe.sequence_length=2", "logger=csv", "jobs=1"]
PLACES = ("datasets", "simulated", "runs", "results")
LIMIT_S = 240
END_S = 10  # by when the workers of a killed command have ended


# A disturbance: prepared folder, folder to work in, wanted digests; what is wrong afterwards.
Fault = Callable[[Path, Path, dict[str, str]], str | None]


@dataclass(frozen=True)
class Phase:
    """A command, and what it leaves.

    Args:
        name: of the phase.
        words: the command's, given its folder.
        left: patterns of the files whose content has to be that of a run that nobody killed.
        before: commands of other phases that come first and are not killed.
    """

    name: str
    words: Callable[[Path], Sequence[str]]
    left: Sequence[str]
    before: Sequence[Phase] = ()


def places(folder: Path) -> list[str]:
    """The folders of a command, all below one."""
    return [f"paths.{name}={folder / name}" for name in PLACES]


def start(phase: Phase, folder: Path) -> subprocess.Popen[str]:
    """Start a command in a session of its own."""
    return subprocess.Popen(
        [sys.executable, *phase.words(folder)],
        cwd=folder,
        env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(REPOSITORY)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def finish(command: subprocess.Popen[str]) -> tuple[int, str]:
    """Wait for a command; its exit status and what it printed."""
    try:
        said, _ = command.communicate(timeout=LIMIT_S)
    except subprocess.TimeoutExpired:
        os.killpg(command.pid, signal.SIGKILL)
        said, _ = command.communicate()
        return -1, f"{said}\nhung for {LIMIT_S} s"
    return command.returncode, said


def prepared(phase: Phase, folder: Path) -> Path:
    """A folder in which everything is done that comes before a phase."""
    folder.mkdir(parents=True)
    for each in phase.before:
        status, said = finish(start(each, folder))
        assert status == 0, said
    return folder


def digests(phase: Phase, folder: Path) -> dict[str, str]:
    """By file what a phase has left, as a hash of what it means."""
    found = {}
    for pattern in phase.left:
        for path in sorted(folder.glob(pattern)):
            if path.is_file() and not path.name.startswith("."):
                found[str(path.relative_to(folder))] = meaning(path)
    return found


def meaning(path: Path) -> str:
    """A hash of events or weights where a file holds them, else of its bytes."""
    digest = hashlib.sha256()
    if path.suffix == ".h5":
        with EventReader(path) as reader:
            events = reader.read()
        for values in (events.t, events.x, events.y, events.p):
            digest.update(np.asarray(values, np.int64).tobytes())
    elif path.suffix == ".ckpt":
        state = torch.load(path, map_location="cpu", weights_only=False)["state_dict"]
        for name in sorted(state):
            digest.update(name.encode() + state[name].contiguous().numpy().tobytes())
    else:
        digest.update(path.read_bytes())
    return digest.hexdigest()


def living(session: int) -> list[int]:
    """Processes of a session that run."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:  # it has just ended
            continue
        if int(fields[3]) == session and fields[0] != "Z":
            found.append(int(stat.parent.name))
    return found


@dataclass
class Count:
    """What came of many tries."""

    tries: int = 0
    equal: int = 0
    faults: tuple[str, ...] = ()

    def add(self, fault: str | None) -> None:
        """Count one try, with what is wrong about it."""
        self.tries += 1
        self.equal += fault is None
        self.faults += () if fault is None else (fault,)

    def __str__(self) -> str:
        return f"{self.tries} tries, {self.equal} ended in equal numbers, {len(self.faults)} faults"


def reference(phase: Phase, base: Path, folder: Path) -> tuple[dict[str, str], float]:
    """What a run leaves that nobody disturbs, and the seconds that it takes."""
    shutil.copytree(base, folder, symlinks=True)
    began = time.monotonic()
    status, said = finish(start(phase, folder))
    assert status == 0, said
    found = digests(phase, folder)
    assert found, f"{phase.name} left nothing below {folder}"
    return found, time.monotonic() - began


def kill_and_repeat(
    phase: Phase, base: Path, folder: Path, moment_s: float, wanted: dict[str, str]
) -> str | None:
    """Kill a command at a moment, type it again, and say what is wrong with what it leaves."""
    shutil.copytree(base, folder, symlinks=True)
    command = start(phase, folder)
    time.sleep(moment_s)
    command.kill()
    command.wait()
    if command.stdout is not None:
        command.stdout.close()
    for _ in range(END_S * 10):
        if not living(command.pid):
            break
        time.sleep(0.1)
    if left := living(command.pid):
        os.killpg(command.pid, signal.SIGKILL)
        return f"killed after {moment_s:.1f} s, {len(left)} of its processes lived on"
    return wrong(phase, folder, finish(start(phase, folder)), wanted, f"killed at {moment_s:.1f} s")


def pair(phase: Phase, base: Path, folder: Path, wanted: dict[str, str]) -> str | None:
    """Start a command twice at once, and say what is wrong with what they leave."""
    shutil.copytree(base, folder, symlinks=True)
    both = [start(phase, folder), start(phase, folder)]
    ends = [finish(each) for each in both]
    if all(status != 0 for status, _ in ends):
        return f"neither of two ended well: {ends[0][1][-500:]} // {ends[1][1][-500:]}"
    if any("Traceback" in said or status < 0 for status, said in ends):
        return f"a traceback: {ends[0][1][-1500:]} // {ends[1][1][-1500:]}"
    return wrong(phase, folder, (0, ""), wanted, "two at once")


def wrong(
    phase: Phase, folder: Path, end: tuple[int, str], wanted: dict[str, str], what: str
) -> str | None:
    """What is wrong about a command's end and files, if anything is."""
    status, said = end
    if status != 0:
        return f"{what}: exit status {status}: {said[-1500:]}"
    found = digests(phase, folder)
    shutil.rmtree(folder)
    if found != wanted:
        differing = {name for name in {*found, *wanted} if found.get(name) != wanted.get(name)}
        return f"{what}: other content of {sorted(differing)[:5]}"
    return None


def moments(phase: Phase, seconds: float, count: int) -> list[float]:
    """Moments at which to kill, most of them after the imports, drawn by lot."""
    draw = random.Random(phase.name)
    return [draw.uniform(0.15, 1.0) * seconds for _ in range(count)]
