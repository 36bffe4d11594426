"""The processor cores that this process may count on."""

from __future__ import annotations

import os

_share = 1

# Below this a part of an image is done before its thread has started.
LEAST_PIXELS = 1 << 15


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
