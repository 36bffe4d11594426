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
from eqs.metrics.definition import choices
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
    ) -> list[dict[str, StreamScore]]:
        """Every reading of every candidate, in one pass of the judge."""
        limits = {"start_us": start_us, "stop_us": stop_us}
        return self.metric.score(real, candidates, self.readings, **limits, watch=watch)


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
    definition = judge.define(**chosen)
    beside = kept_taps(judge) if cfg.taps is None else cfg.taps
    taps = list(dict.fromkeys([definition.tap, *beside]))
    require_taps(judge.backbone, taps)
    content = training_content(training)

    def lacks(tap: str) -> bool:
        centre = judge.centre_for(replace(definition, tap=tap))
        if centre is None or centre.sha256 in given or not content:
            return centre is None
        return centre.recordings != content

    missing = [tap for tap in taps if lacks(tap)]
    if missing and training is not None:
        log.info("centring the judge on the training recordings of %s", training.name)
        judge = centred(judge, training, missing, cfg.eqs.chunk_windows, chosen)
        judge.save(folder)
    # Partial, since Hydra would take the judge for a configuration and open it.
    metric = instantiate(cfg.eqs, judge=None, _partial_=True)(judge=judge).to(device)
    return Scoring(metric=metric, readings=readings_of(metric, taps))


def readings_of(metric: EventQualityScore, taps: Sequence[str]) -> tuple[Reading, ...]:
    """The metric's own reading, then every tap raw and, where there are centres, otherwise too."""
    judge, headline = metric.judge, metric.reading.definition
    kinds = ["raw", *sorted({"centred", headline.features} - {"raw"})]
    readings = []
    for features in kinds:
        for tap in taps:
            definition = replace(headline, tap=tap, features=features)
            centre = None if features == "raw" else judge.centre_for(definition)
            if features == "raw" or centre is not None:
                readings.append(Reading(definition=definition, centre=centre))

    def distance_to_headline(reading: Reading) -> tuple[bool, bool]:
        chosen = reading.definition
        return chosen.tap != headline.tap, chosen.features != headline.features

    return tuple(sorted(readings, key=distance_to_headline))
