"""What a command scores with: its judge and everything that it reads."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from hydra.utils import instantiate
from omegaconf import DictConfig

from eqs.data import Dataset
from eqs.events import EventReader
from eqs.metrics import EventQualityScore, Judge, Reading, StreamScore
from eqs.metrics.definition import VERSION_1, Definition, choices
from eqs.metrics.features import require_taps
from eqs.metrics.scoring import Watcher
from eqs.pipelines.judge import (
    centred,
    find_judge,
    kept_taps,
    scoring_device,
    training_content,
)

log = logging.getLogger(__name__)
POOLING = ("patch", "patch_size", "pooling")


@dataclass(frozen=True, kw_only=True)
class Scoring:
    """The metric of a command with every reading that it reports.

    Args:
        metric: the headline, on the device that scores.
        readings: every reading, the headline first.
    """

    metric: EventQualityScore
    readings: tuple[Reading, ...]

    @property
    def judge(self) -> Judge:
        """Network, hashes and description of what scores."""
        return self.metric.judge

    @property
    def headline(self) -> Reading:
        """The reading that is the column `eqs`."""
        return self.metric.reading

    def score(
        self,
        real: EventReader | Any,  # noqa: ANN401
        candidates: Sequence[Any],
        *,
        start_us: int,
        stop_us: int,
        watch: Watcher | None = None,
        keep: Sequence[int] = (),
    ) -> list[dict[str, StreamScore]]:
        """Every reading of every candidate, in one pass of the judge."""
        limits = {"start_us": start_us, "stop_us": stop_us}
        return self.metric.score(real, candidates, self.readings, **limits, watch=watch, keep=keep)


def find_scoring(cfg: DictConfig, data: Dataset | None) -> Scoring:
    """The configured judge and choices, with the centres that they need.

    Args:
        cfg: a configuration with `eqs`, `taps` and `device`.
        data: the data set, whose training recordings a judge without centres is centred on.

    Raises:
        ValueError: there is no judge, or no such device, or a choice does not fit the judge.
    """
    device = scoring_device(cfg.device)
    judge, folder, training, given = find_judge(cfg, data)
    judge.to(device)
    chosen = {name: cfg.eqs[name] for name in choices() if cfg.eqs[name] is not None}
    headline = judge.define(**chosen)
    beside = kept_taps(judge) if cfg.taps is None else cfg.taps
    taps = list(dict.fromkeys([headline.tap, *beside]))
    require_taps(judge.backbone, taps)
    content = training_content(training)

    def lacks(definition: Definition) -> bool:
        centre = judge.centre_for(definition)
        if centre is None or centre.sha256 in given or not content:
            return centre is None
        return centre.recordings != content

    wanted = [each for each in definitions_of(headline, taps) if each.needs_centre and lacks(each)]
    if wanted and training is not None:
        log.info("centring the judge on the training recordings of %s", training.name)
        for pooled in dict.fromkeys(each.maps._replace(tap="") for each in wanted):
            some = [each for each in wanted if each.maps._replace(tap="") == pooled]
            pooling = {name: getattr(some[0], name) for name in POOLING}
            of_taps = list(dict.fromkeys(each.tap for each in some))
            judge = centred(judge, training, of_taps, cfg.eqs.chunk_windows, {**chosen, **pooling})
        judge.save(folder)
    # Partial, since Hydra would take the judge for a configuration and open it.
    metric = instantiate(cfg.eqs, judge=None, _partial_=True)(judge=judge).to(device)
    return Scoring(metric=metric, readings=readings_of(metric, taps))


def readings_of(metric: EventQualityScore, taps: Sequence[str]) -> tuple[Reading, ...]:
    """Those of `definitions_of` for which the metric's judge has what they need."""
    judge, readings = metric.judge, [metric.reading]
    for definition in definitions_of(metric.definition, taps)[1:]:
        centre = judge.centre_for(definition) if definition.needs_centre else None
        if not definition.needs_centre or centre is not None:
            readings.append(Reading(definition=definition, centre=centre))
    return tuple(readings)


def definitions_of(headline: Definition, taps: Sequence[str]) -> list[Definition]:
    """What stands beside a headline: the same of other activations, and what earlier scores were.

    These are the centred cosine of version 1 and the raw cosine that the paper's formulas say.

    Convention: whatever has the headline's tap and features is the headline itself.
    """
    like = [replace(headline, tap=tap) for tap in taps]
    version_1 = [replace(each, **VERSION_1) for each in like]
    raw = [replace(each, features="raw") for each in version_1]
    by_column = {each.column: each for each in [headline, *like, *version_1, *raw]}
    by_column[headline.column] = headline
    order = sorted(by_column.values(), key=lambda each: each.tap != headline.tap)
    return sorted(order, key=lambda each: each.column != headline.column)
