"""Reverse mAP: a detector trained on real events, tested on simulated ones.

What such a detector still finds in a simulated stream says how familiar the stream looks to it:
another score of a simulator that needs no training on it.
"""

from __future__ import annotations

from collections.abc import Mapping

from eqs.data import Dataset, EventSource
from eqs.pipelines.runs import Run
from eqs.pipelines.testing import accuracies


def reverse_precision(
    run: Run, data: Dataset, systems: Mapping[str, EventSource]
) -> dict[str, float]:
    """Test a finished detector on the test events of each system; its mAP by name.

    Args:
        run: a detector trained on real events.
        data: its data set.
        systems: simulated events, made where they are missing.
    """
    for source in systems.values():
        source.prepare(data.recordings("test"))
    return {name: found.map for name, found in accuracies(run, data, systems).items()}
