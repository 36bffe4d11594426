"""Reverse mAP: a detector trained on real events, tested on simulated ones.

What such a detector still finds in a simulated stream says how familiar the stream looks to it:
another score of a simulator that needs no training on it.
"""

from __future__ import annotations

from collections.abc import Mapping

from hydra.utils import instantiate

from eqs.data import Dataset, EventSource, RecordedEvents
from eqs.pipelines.runs import Run
from eqs.pipelines.train import build_task


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
    config = run.config()
    protocol = instantiate(config.protocol)
    task = build_task(config, protocol, list(systems))
    datamodule = instantiate(config.datamodule)(
        dataset=data, protocol=protocol, source=RecordedEvents(), tests=systems
    )
    trainer = instantiate(
        config.trainer,
        devices=1,
        strategy="auto",
        logger=False,
        enable_checkpointing=False,
        enable_progress_bar=False,
    )
    trainer.test(task, datamodule, ckpt_path=run.weights, verbose=False)
    return {name: task.measured[name].map for name in systems}
