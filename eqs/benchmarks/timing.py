"""Measure one computation in a process of its own, so that memory peaks do not mix."""

from __future__ import annotations

import multiprocessing
import resource
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple, TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")


class Cost(NamedTuple):
    """Seconds of one run, and MiB of memory beyond what the process held before."""

    seconds: float
    peak_mib: float


def peak_mib() -> float:
    """The most memory this process has held so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def time_runs(run: Callable[[], object], least_seconds: float = 2.0, least_runs: int = 3) -> Cost:
    """The fastest of some runs after a first one, which compiles and reserves memory."""
    before = peak_mib()
    run()
    seconds: list[float] = []
    while len(seconds) < least_runs or sum(seconds) < least_seconds:
        start = time.perf_counter()
        run()
        seconds.append(time.perf_counter() - start)
    return Cost(min(seconds), peak_mib() - before)


def in_own_process(measure: Callable[[Job], Result], job: Job) -> Result:
    """Call `measure(job)` in a fresh process."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool:  # which may start processes itself
        return pool.submit(measure, job).result()
