"""What the detector that a training starts from was trained on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from omegaconf import DictConfig

from eqs.content import content_hash
from eqs.data import EventSource, MixedEvents
from eqs.files import short_hash
from eqs.models.checkpoint import RECORD, read_content, weights_file
from eqs.names import REFERENCE
from eqs.pipelines.result import RunResult, Stage
from eqs.pipelines.runs import Run

UNKNOWN = "weights"  # trained here, but its record does not lie beside them


@dataclass(frozen=True, kw_only=True)
class Start:
    """A detector trained here, whose weights another training starts from.

    Args:
        name: of its simulator.
        stages: what it was trained on.
        weights: hash of the weights' content.
    """

    name: str
    stages: tuple[Stage, ...]
    weights: str


def start_of(cfg: DictConfig) -> Start | None:
    """What a training starts from; None for random weights and for those of other programs.

    Published weights are part of the recipe: they are the same for whatever is compared.

    Raises:
        FileNotFoundError: there are no such weights.
        ValueError: the file is no checkpoint.
    """
    given = cfg.model.get("weights")
    if given is None:
        return None
    path = weights_file(given)
    content = content_hash(path)
    for run in (Run(path.parent), Run(path.parent.parent)):  # its weights, or a checkpoint
        if run.finished:
            return Start(name=run.result.simulator, stages=named(run.result), weights=content)
    if RECORD not in read_content(path):
        return None
    return Start(name=UNKNOWN, stages=({UNKNOWN: 1.0},), weights=content)


def named(result: RunResult) -> tuple[Stage, ...]:
    """The stages of a training, whose last names the sensor of real events if it was a chosen one.

    For what follows may see those of another sensor.
    """
    *before, last = result.stages
    seen = f"{REFERENCE} of {result.sensor}" if result.sensor else REFERENCE
    return (*before, {seen if name == REFERENCE else name: last[name] for name in last})


def trained_as(source: EventSource, start: Start | None) -> Mapping[str, Any]:
    """What a result says of the events that its detector saw: simulator, system and stages.

    A detector that saw others before is called after both, so that nobody takes it for one that
    saw these alone.
    """
    stage = source.parts if isinstance(source, MixedEvents) else {source.name: 1.0}
    if start is None:
        return {"simulator": source.name, "system": source.label, "stages": (stage,)}
    name = f"{start.name}_then_{source.name}"
    system = f"{name}-{short_hash([start.weights, source.label])}"
    return {"simulator": name, "system": system, "stages": (*start.stages, stage)}
