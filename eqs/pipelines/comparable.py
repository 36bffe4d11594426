"""Which finished runs can stand in one table, on the events of the sensor that was chosen."""

from __future__ import annotations

import logging
from collections.abc import Sequence

from omegaconf import DictConfig

from eqs.files import short_hash
from eqs.pipelines.build import dataset
from eqs.pipelines.recipe import WEIGHTS, apart, data_hash, differences, recipe
from eqs.pipelines.resume import LISTED, NAMED_APART
from eqs.pipelines.runs import Run
from eqs.pipelines.sensors import other_sensor, own_events, sensor_label
from eqs.pipelines.testing import on_other_sensor

log = logging.getLogger(__name__)


def comparable_runs(cfg: DictConfig, found: Sequence[Run]) -> list[Run]:
    """The runs of the configured recipe on the data as they are; others are named and left out.

    A run that started from the weights of another may differ in these: its row says from which.
    One that saw no real events is found whichever sensor is chosen, and tested on its events.
    """
    wanted, other, here = recipe(cfg), other_sensor(cfg), sensor_label(cfg)
    named, data = short_hash(wanted), data_hash(dataset(own_events(cfg)))
    seeing = [run for run in found if run.result.saw_real and run.result.sensor == here]
    seen = data_hash(dataset(cfg)) if seeing and other is not None else data
    kept = []
    for run in found:
        there = {key: value for key, value in run.recipe().items() if key not in NAMED_APART}
        started = there and run.result.before and apart(there, wanted) <= {WEIGHTS}
        same = run.result.recipe == named or started
        foreign = run.result.saw_real and run.result.sensor != here
        expected = seen if run.result.saw_real else data
        if same and not foreign and run.result.data == expected:
            kept.append(run)
            continue
        reasons = differences(there, wanted) if there and not same else []
        if foreign:
            reasons.insert(0, f"real events of {run.result.sensor or 'the own sensor'}")
        elif run.result.data != expected:
            reasons.insert(0, "other data")
        shown = ", ".join(reasons[:LISTED]) or "another recipe"
        more = f" and {len(reasons) - LISTED} more" if len(reasons) > LISTED else ""
        log.info("left out %s: %s%s", run.folder, shown, more)
    if other is None:
        return kept
    looked_at = dataset(cfg)
    return [
        run if run.result.saw_real else on_other_sensor(run, other, looked_at, cfg) for run in kept
    ]
