"""The Event Quality Score as a torchmetrics metric."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
from torch import Tensor
from torchmetrics import Metric

from eqs.metrics.definition import Definition, choices
from eqs.metrics.judge import Judge
from eqs.metrics.reading import Reading
from eqs.metrics.scoring import StreamScore, Watcher, score_streams, score_tensors
from eqs.metrics.silence import Silence
from eqs.metrics.windows import StreamOrHistograms


class EventQualityScore(Metric):
    r"""How similar a simulated event stream looks to a real one, to a trained detector.

    Both streams are cut into the same windows and run side by side through the first stages of a
    recurrent backbone. With :math:`a` and :math:`b` the hidden states of a stage, minus the
    judge's response to silence, the score is their agreement,

    .. math:: \mathrm{EQS} = \frac{1}{K S} \sum_{k,s} \frac{2 \sum_p a_{ksp} \cdot b_{ksp}}
        {\sum_p \|a_{ksp}\|^2 + \sum_p \|b_{ksp}\|^2}

    over windows :math:`k` after the warm-up, stages :math:`s` and cells :math:`p`. Other choices
    (`Definition`) read other activations, subtract the mean real feature or nothing, whiten, pool
    cells to patches or take the mean cosine, as the first version and the paper do. `compute`
    returns the unweighted mean over updates, one update being one sequence.

    Convention: EQS is a similarity in [-1, 1], higher is better, 1 for identical streams; the
    distance is `1 - EQS`. The published text defines the distance and tabulates the similarity.
    A stream without events is silence, scored over the extent of the real stream.

    Source: Chanda et al., "Event Quality Score (EQS)", CVPR Workshops 2025, arXiv 2504.12515.

    Args:
        judge: what scores: a folder with `judge.json`, as `train.py sim=real` leaves it; the
            checkpoint of a detector trained on real events; "random", a control; or a `Judge`.
        partition_split_32: of a bare checkpoint, where it is not 2; a folder knows its own.
        chunk_windows: windows per pass; chosen from the sensor size if None. It changes memory
            and speed, not the score.
        **others: any choice of `Definition`, by its name, None for what the judge says; the rest
            is passed on to `torchmetrics.Metric`.

    Raises:
        FileNotFoundError: there is no such judge.
        ValueError: a choice is out of range, unknown, or does not fit the judge.

    Example:
        >>> from eqs.events import Events
        >>> events = Events.from_arrays([0, 60_000, 99_999], [1, 5, 9], [2, 2, 2], [1, 0, 1],
        ...                             height=32, width=32)
        >>> score = EventQualityScore("random", features="raw")
        >>> score.update(events, events)
        >>> round(float(score.compute()), 4)
        1.0
    """

    higher_is_better = True
    is_differentiable = False  # `update` and `compute` are not; `loss` is
    full_state_update = False
    plot_lower_bound = -1.0
    plot_upper_bound = 1.0

    total: Tensor
    sequences: Tensor

    def __init__(
        self,
        judge: Judge | Path | str,
        *,
        partition_split_32: int | None = None,
        chunk_windows: int | None = None,
        **others: Any,  # noqa: ANN401
    ) -> None:
        """Load the judge and check that everything fits."""
        chosen = {name: others.pop(name) for name in choices() if name in others}
        super().__init__(**others)
        if not isinstance(judge, Judge):
            judge = Judge.load(judge, partition_split_32)
        given = {name: value for name, value in chosen.items() if value is not None}
        self.judge = judge
        self.reading = judge.reading(**given)
        self.chunk_windows = chunk_windows
        self.last: StreamScore | None = None
        self.backbone = judge.backbone
        self.silence = Silence(judge.backbone, judge.device)
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
    def weights_sha256(self) -> str:
        """Hash of the judge's weights."""
        return self.judge.weights_sha256

    @property
    def centre_sha256(self) -> str | None:
        """Hash of the centre, or None for a raw score."""
        return self.reading.centre.sha256 if self.reading.centre else None

    def score(
        self,
        real: StreamOrHistograms,
        candidates: Sequence[StreamOrHistograms],
        readings: Sequence[Reading] = (),
        *,
        start_us: int | None = None,
        stop_us: int | None = None,
        watch: Watcher | None = None,
        keep: Sequence[int] = (),
    ) -> list[dict[str, StreamScore]]:
        """Score several streams against one, which runs through the judge once; nothing is kept.

        Args:
            real: stream of the real sensor.
            candidates: streams of the same kind, sensor and clock.
            readings: what to read, if not this metric's own reading alone; they may differ in tap
                and features.
            start_us: start of the first window; by default see `window_starts`.
            stop_us: time that no window may pass; by default see `window_starts`.
            watch: sees the features of every window that counts.
            keep: numbers of windows whose maps are kept.

        Returns:
            For each candidate the scores by name of the reading.

        Raises:
            ValueError: as for `update`.
        """
        return score_streams(
            self.backbone,
            real,
            candidates,
            readings or [self.reading],
            start_us=start_us,
            stop_us=stop_us,
            chunk_windows=self.chunk_windows,
            silence=self._silence(),
            watch=watch,
            keep=keep,
            device=self.judge.device,
        )

    def _silence(self) -> Silence:
        """The responses to nothing, computed anew where the judge has moved."""
        if self.silence.device != self.judge.device:
            self.silence = Silence(self.backbone, self.judge.device)
        return self.silence

    def update(
        self,
        simulated: StreamOrHistograms,
        real: StreamOrHistograms,
        start_us: int | None = None,
        stop_us: int | None = None,
    ) -> None:
        """Score one sequence; its details are then in `last`.

        Args:
            simulated: event stream, or histograms of shape (windows, 2 * bins, height, width).
            real: stream of the same kind, sensor and clock.
            start_us: start of the first window; by default see `window_starts`.
            stop_us: time that no window may pass; by default see `window_starts`.

        Raises:
            ValueError: the sensors or shapes differ, the streams do not share a whole window, a
                histogram or a feature is not finite.
        """
        (scores,) = self.score(real, [simulated], start_us=start_us, stop_us=stop_us)
        self.last = scores[self.reading.name]
        # Not in place: Lightning resets metrics under inference mode, which would forbid it.
        self.total = self.total + self.last.score
        self.sequences = self.sequences + 1

    def compute(self) -> Tensor:
        """Unweighted mean over the sequences seen.

        Raises:
            ValueError: there was no update.
        """
        if not self.sequences:
            raise ValueError("Expected at least one update before compute, got none")
        return self.total / self.sequences

    def loss(self, simulated: Tensor, real: Tensor) -> Tensor:
        """The distance `1 - EQS` of one sequence with gradients; the metric's state stays as it is.

        Args:
            simulated: float histograms, as of `soft_histogram`, shape (windows, 2 * bins, height,
                width).
            real: histograms of the same shape.

        Raises:
            ValueError: the shapes differ, or a histogram or a feature is not finite.
        """
        return 1.0 - score_tensors(
            self.backbone,
            real,
            simulated,
            self.reading,
            silence=self._silence(),
            device=self.judge.device,
        )

    def reset(self) -> None:
        """Forget all sequences."""
        super().reset()
        self.last = None
