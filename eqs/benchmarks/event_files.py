"""Time `eqs convert` and `eqs info` on long files, and measure the memory that they take."""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from eqs.benchmarks.timing import in_own_process

HEIGHT, WIDTH = 720, 1280
VECTORS = WIDTH // 12  # words of 12 columns, one row of the sensor
ROWS_AT_ONCE = 10_000


@dataclass(frozen=True)
class Job:
    """One command on one file.

    Args:
        arguments: what is typed after the verb.
        verb: convert or info.
    """

    verb: str
    arguments: tuple[str, ...]


def write_evt3(path: Path, events: int) -> int:
    """Write random vectors of EVT3, one row every microsecond or two; gives the true number."""
    generator = np.random.default_rng(0)
    written, now = 0, 0
    with path.open("wb") as file:
        file.write(f"% evt 3.0\n% geometry {WIDTH}x{HEIGHT}\n% end\n".encode())
        while written < events:
            times = now + np.cumsum(generator.integers(1, 3, ROWS_AT_ONCE))
            now = int(times[-1])
            masks = generator.integers(0, 1 << 12, (ROWS_AT_ONCE, VECTORS))
            polarity = generator.integers(0, 2, ROWS_AT_ONCE)
            words = np.empty((ROWS_AT_ONCE, 4 + VECTORS), "<u2")
            words[:, 0] = 8 << 12 | times >> 12 & 0xFFF
            words[:, 1] = 6 << 12 | times & 0xFFF
            words[:, 2] = generator.integers(0, HEIGHT, ROWS_AT_ONCE)
            words[:, 3] = 3 << 12 | polarity << 11
            words[:, 4:] = 4 << 12 | masks
            file.write(words.tobytes())
            written += int(np.bitwise_count(masks).sum())
    return written


def measure(job: Job) -> tuple[float, float]:
    """Seconds of one command, and the most memory in MiB of a process that runs it alone."""
    start = time.perf_counter()
    command = [sys.executable, "-m", "eqs", job.verb, *job.arguments]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    return time.perf_counter() - start, peak


def print_table(events: int) -> None:
    """Print what converting and describing a RAW file, and describing the result, take."""
    table = Table(title="Event files", title_justify="left")
    for name in ("command", "events", "file, MB", "seconds", "million a second", "peak, MiB"):
        table.add_column(name, justify="left" if name == "command" else "right")
    with tempfile.TemporaryDirectory() as folder:
        raw, dsec = Path(folder) / "long.raw", Path(folder) / "long.h5"
        count = write_evt3(raw, events)
        jobs = {
            "info of RAW": Job("info", (str(raw),)),
            "convert RAW to DSEC": Job("convert", (str(raw), str(dsec))),
            "info of DSEC": Job("info", (str(dsec),)),
        }
        for name, job in jobs.items():
            seconds, mib = in_own_process(measure, job)
            size = Path(job.arguments[0]).stat().st_size / 1e6
            table.add_row(
                name, f"{count:,}", f"{size:,.0f}", f"{seconds:.1f}",
                f"{count / seconds / 1e6:.1f}", f"{mib:,.0f}",
            )  # fmt: skip
    Console(width=100).print(table)
