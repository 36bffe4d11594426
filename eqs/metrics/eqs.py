"""The Event Quality Score as a torchmetrics metric."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from torch import Tensor
from torchmetrics import Metric

from eqs.metrics.centre import Centre
from eqs.metrics.definition import Definition, weights_sha256
from eqs.metrics.features import TappedBackbone
from eqs.metrics.scoring import Reading, StreamScore, score_streams
from eqs.metrics.windows import Stream


class EventQualityScore(Metric):
    r"""How similar a simulated event stream looks to a real one, to a trained detector.

    Both streams are cut into the same windows and run side by side through the first stages of a
    recurrent backbone. The score is the mean cosine between their patch-pooled features,

    .. math:: \mathrm{EQS} = \frac{1}{K S} \sum_{k,s} \frac{1}{P_s} \sum_p
        \cos(f_{ksp}^{sim} - m_s,\; f_{ksp}^{real} - m_s)

    over windows :math:`k` after the warm-up, stages :math:`s` and patches :math:`p`, with the mean
    real feature :math:`m_s` where the score is centred and zero where it is not; whitened vectors
    are also multiplied by a matrix :math:`W_s` (`whitening_matrix`). `compute` returns the
    unweighted mean over updates, one update being one sequence.

    Convention: EQS is a similarity in [-1, 1], higher is better, 1 for identical streams; the
    distance is `1 - EQS`. The published text defines the distance and tabulates the similarity.
    A stream without events is silence, scored over the extent of the other stream.

    Source: Chanda et al., "Event Quality Score (EQS)", CVPR Workshops 2025, arXiv 2504.12515.

    Args:
        weights: checkpoint of a detector trained on real events, or "random" as a control.
        tap: which activation is compared: gate (the paper's formula), gate_logits, hidden, cell,
            attention or downsample.
        centre: mean real feature: a file, a `Centre`, or one tensor per stage; for `whitened`
            features with its covariance, so no tensors.
        features: compared `raw`, `centred`, minus the mean real feature, or also `whitened` by
            its covariance; None takes `centred` with a centre and `raw` without.
        stages: stages of the backbone, counted from 1.
        patch: `cells`, squares of so many cells, or `grid`, the map cut into so many by so many.
        patch_size: side of a patch in cells, or patches per side of the map.
        pooling: `box`, the mean of a patch's cells, or `smooth`, weights that fall off into the
            neighbouring patches.
        state: `carried` from window to window, or `reset` to zero before each.
        mask: `none`, or `active`: only patches in which either stream has events count.
        bins: time bins per window and polarity.
        window_us: length of a window in microseconds.
        count_cutoff: events per pixel and bin at which the histogram saturates.
        span: time the bins cover, the whole `window` or first to last of its `events`.
        counts: `raw`, or `normalised`: each window is scaled to one mean count.
        warmup_windows: most windows dropped at the start; never more than a quarter of a stream.
        size: size of the RVT backbone.
        partition_split_32: attention windows per side of the backbone's last stage.
        seed: seed of the random weights.
        backbone: any network with `taps`, instead of weights.
        chunk_windows: windows per pass; chosen from the sensor size if None. It changes memory
            and speed, not the score.
        **kwargs: passed on to `torchmetrics.Metric`.

    Raises:
        FileNotFoundError: the weights or the centre are no file.
        ValueError: a choice is out of range, or weights, backbone and centre do not fit together.
    """

    higher_is_better = True
    is_differentiable = False
    full_state_update = False
    plot_lower_bound = -1.0
    plot_upper_bound = 1.0

    total: Tensor
    sequences: Tensor

    def __init__(
        self,
        weights: Path | str | None = None,
        *,
        tap: str = "hidden",
        centre: Centre | Path | str | Sequence[Tensor] | None = None,
        features: Literal["raw", "centred", "whitened"] | None = None,
        stages: Sequence[int] = (1, 2, 3),
        patch: Literal["cells", "grid"] = "cells",
        patch_size: int = 3,
        pooling: Literal["box", "smooth"] = "box",
        state: Literal["carried", "reset"] = "carried",
        mask: Literal["none", "active"] = "none",
        bins: int = 10,
        window_us: int = 50_000,
        count_cutoff: int = 10,
        span: Literal["window", "events"] = "window",
        counts: Literal["raw", "normalised"] = "raw",
        warmup_windows: int = 20,
        size: str = "small",
        partition_split_32: int = 2,
        seed: int = 0,
        backbone: TappedBackbone | None = None,
        chunk_windows: int | None = None,
        **kwargs: object,
    ) -> None:
        """Load the judge and check that everything fits."""
        super().__init__(**kwargs)
        if (weights is None) == (backbone is None):
            raise ValueError(
                "Expected either weights or a backbone, got "
                f"{'neither' if weights is None else 'both'}; set eqs.weights to a checkpoint "
                'trained on real events, or to "random"'
            )
        definition = Definition(
            tap=tap,
            features=features or ("raw" if centre is None else "centred"),
            stages=tuple(stages),
            patch=patch,
            patch_size=patch_size,
            pooling=pooling,
            state=state,
            mask=mask,
            bins=bins,
            window_us=window_us,
            count_cutoff=count_cutoff,
            span=span,
            counts=counts,
            warmup_windows=warmup_windows,
            architecture=f"rvt-{size}-split{partition_split_32}"
            if backbone is None
            else type(backbone).__name__,
        )
        self.reading = Reading(definition=definition, centre=_as_centre(centre, tap, stages))
        self.chunk_windows = chunk_windows
        self.last: StreamScore | None = None
        self.weights_sha256: str | None = None
        if backbone is None:
            backbone, self.weights_sha256 = load_backbone(
                str(weights), size=size, bins=bins, partition_split_32=partition_split_32, seed=seed
            )
        self.backbone = backbone
        self.add_state("total", torch.zeros((), dtype=torch.float64), dist_reduce_fx="sum")
        self.add_state("sequences", torch.zeros((), dtype=torch.int64), dist_reduce_fx="sum")

    @property
    def definition(self) -> Definition:
        """Every choice of this score except the judge."""
        return self.reading.definition

    @property
    def definition_hash(self) -> str:
        """Short hash of the definition, to stand beside every score."""
        return self.definition.hash

    @property
    def centre_sha256(self) -> str | None:
        """Hash of the centre, or None for a raw score."""
        return self.reading.centre.sha256 if self.reading.centre else None

    def update(
        self,
        simulated: Stream,
        real: Stream,
        start_us: int | None = None,
        stop_us: int | None = None,
    ) -> None:
        """Score one sequence; its details are then in `last`.

        Args:
            simulated: event stream, or histograms of shape (windows, 2 * bins, height, width).
            real: stream of the same kind, sensor and clock.
            start_us: start of the first window; by default where both streams have begun.
            stop_us: time that no window may pass; by default where the first stream ends.

        Raises:
            ValueError: the sensors or shapes differ, the streams do not share a whole window, a
                histogram or a feature is not finite.
        """
        ((self.last,),) = (
            scores.values()
            for scores in score_streams(
                self.backbone,
                real,
                [simulated],
                [self.reading],
                start_us=start_us,
                stop_us=stop_us,
                chunk_windows=self.chunk_windows,
                device=self.device,
            )
        )
        self.total += self.last.score
        self.sequences += 1

    def compute(self) -> Tensor:
        """Unweighted mean over the sequences seen.

        Raises:
            ValueError: there was no update.
        """
        if not self.sequences:
            raise ValueError("Expected at least one update before compute, got none")
        return self.total / self.sequences

    def reset(self) -> None:
        """Forget all sequences."""
        super().reset()
        self.last = None


def load_backbone(
    weights: Path | str,
    *,
    size: str = "small",
    bins: int = 10,
    partition_split_32: int = 2,
    seed: int = 0,
) -> tuple[TappedBackbone, str]:
    """The backbone of a detector checkpoint, or one with seeded random weights.

    Args:
        weights: path of a checkpoint, or "random".
        size: size of the backbone.
        bins: time bins per polarity, hence half the input channels.
        partition_split_32: attention windows per side of the last stage.
        seed: seed of the random weights.

    Returns:
        The backbone, frozen in evaluation mode, and the sha256 of its weights.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the weights do not fit.
    """
    from eqs.models import RVTDetector

    if weights == "random":
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            model = RVTDetector(
                size=size, in_channels=2 * bins, partition_split_32=partition_split_32
            )
        digest = weights_sha256(model.backbone)
    else:
        digest = weights_sha256(weights)
        model = RVTDetector.from_checkpoint(weights, partition_split_32=partition_split_32)
        _check_fit(model.size, size, "size")
        _check_fit(model.backbone.in_channels, 2 * bins, "bins")
    return model.backbone.eval().requires_grad_(False), digest


def _check_fit(found: str | int, wanted: str | int, key: str) -> None:
    if found != wanted:
        what = "a backbone of size" if key == "size" else "weights for input channels"
        raise ValueError(f"Expected {what} {wanted}, got {found}; set eqs.{key} or eqs.weights")


def _as_centre(
    centre: Centre | Path | str | Sequence[Tensor] | None, tap: str, stages: Sequence[int]
) -> Centre | None:
    if centre is None or isinstance(centre, Centre):
        return centre
    if isinstance(centre, str | Path):
        return Centre.load(centre)
    if len(centre) != len(stages):
        raise ValueError(
            f"Expected a centre for each of the stages {tuple(stages)}, got {len(centre)}; "
            "set eqs.centre"
        )
    means = tuple(np.asarray(torch.as_tensor(mean).cpu(), dtype=np.float32) for mean in centre)
    return Centre(tap=tap, stages=tuple(stages), means=means)
