"""The processor cores that this process may count on, and work dealt to several of them."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import wait
from typing import TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")
_share = 1

# Below this a part of an image is done before its thread has started.
LEAST_PIXELS = 1 << 15
PR_SET_PDEATHSIG = 1  # of Linux's prctl: the signal that a process gets when its parent ends


def share_cores(processes: int) -> None:
    """Say that so many processes work side by side: each counts on its part of the cores."""
    global _share
    _share = processes


def available_cores() -> int:
    """Cores this process may use and does not share, at least one."""
    # A container may grant fewer than there are.
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(1, (usable or 1) // _share)


def useful_bands(pixels: int) -> int:
    """How many bands of a sensor this machine's cores finish soonest."""
    return max(1, min(available_cores(), pixels // LEAST_PIXELS))


def side_by_side(
    work: Callable[[Job], Result], jobs: Sequence[Job], workers: int
) -> Generator[Result]:
    """Do jobs in processes of their own; the results come as they are ready.

    Who stops listening, by an exception or Ctrl-C, stops the work: processes clear away what they
    have half written and end. If this process is killed, they end with it.

    Args:
        work: a function of a module, given one job.
        jobs: what it is given.
        workers: processes at once; they share the cores.

    Raises:
        OSError: a process was killed, for instance for want of memory.
    """
    others = set(multiprocessing.active_children())
    # A fresh interpreter per worker: nothing inherited, and the same on every system.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(
        workers, mp_context=context, initializer=_begin, initargs=(workers,)
    ) as pool:
        try:
            for done in as_completed([pool.submit(work, job) for job in jobs]):
                yield done.result()
        except BrokenProcessPool as error:
            raise OSError(
                f"Expected {workers} processes to work side by side, got one that was killed, as "
                "happens where memory runs out; set fewer workers, or type the command again to "
                "go on"
            ) from error
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in set(multiprocessing.active_children()) - others:
                worker.terminate()
            raise


def _begin(workers: int) -> None:
    """Leave Ctrl-C to the process that asked, and end tidily when it says so."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    end_with_parent()
    share_cores(workers)


def end_with_parent() -> None:
    """Let this process end when the one that started it does, even if that one was killed.

    Whoever types the command again then meets nobody who still writes. A thread watches on every
    system; Linux also ends a process whose compiled code lets no thread run.
    """
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    # Begun after that, so that a parent that ended in between is noticed here.
    threading.Thread(target=_watch, args=(parent.sentinel,), daemon=True).start()


def _watch(sentinel: int) -> None:
    wait([sentinel])
    os._exit(1)
