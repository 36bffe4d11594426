"""Scores of event streams against a reference stream, in one pass of the backbone."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from eqs.metrics.definition import OF_A_READING, Definition, Maps
from eqs.metrics.features import Pooled, TappedBackbone, pooled_features, strides_of
from eqs.metrics.reading import Comparison, Reading, mean_over_patches
from eqs.metrics.silence import Silence
from eqs.metrics.similarity import combine_maps
from eqs.metrics.windows import StreamOrHistograms, group_chunks

Watcher = Callable[[Mapping[Maps, Sequence[Tensor]]], None]
"""Sees the pooled features of every window that counts: by maps and stage a tensor of shape
(windows, streams, channels, rows, columns), the reference first."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StreamScore:
    """How similar one stream is to the reference, and where and when.

    Args:
        score: mean over windows after the warm-up, in [-1, 1], higher is better.
        by_stage: the same for each stage alone.
        map: mean over windows and stages, by patch of the finest stage, shape (rows, columns);
            NaN where no window counts.
        patch_px: side of a patch of the map in pixels; None where the map is cut evenly.
        curve: score of every window, warm-up included, shape (windows,); NaN where no patch counts.
        warmup: windows at the start that do not count.
        window_maps: maps of the windows that were asked for, by their number.
    """

    score: float
    by_stage: tuple[float, ...]
    map: NDArray[np.float64]
    patch_px: int | None
    curve: NDArray[np.float64]
    warmup: int
    window_maps: Mapping[int, NDArray[np.float64]] = field(default_factory=dict)

    @property
    def distance(self) -> float:
        """One minus the score; lower is better."""
        return 1.0 - self.score

    @property
    def n_windows(self) -> int:
        """Windows that count."""
        return len(self.curve) - self.warmup


def score_group(
    backbone: TappedBackbone,
    chunks: Iterable[Tensor],
    n_windows: int,
    readings: Sequence[Reading],
    *,
    silence: Silence | None = None,
    watch: Watcher | None = None,
    keep: Sequence[int] = (),
    device: torch.device | str = "cpu",
) -> list[dict[str, StreamScore]]:
    """Score many streams against one reference, under many readings, in one pass.

    The reference runs through the backbone once, whatever the number of candidates; memory does
    not grow with the length of the streams.

    Args:
        backbone: the judge's network.
        chunks: histograms, shape (windows, 1 + candidates, 2 * bins, height, width) each; the
            reference comes first.
        n_windows: windows in all chunks together.
        readings: readings that share one pass, see `Definition.one_pass`.
        silence: the judge's responses to nothing, as far as they are known.
        watch: sees the same features.
        keep: numbers of windows whose maps are kept.
        device: where the backbone lives.

    Returns:
        For each candidate the scores by name of the reading.

    Raises:
        ValueError: the readings do not share one pass, or a feature is not finite.
    """
    first = _shared_pass(readings)
    silence = silence or Silence(backbone, device)
    definitions = [reading.definition for reading in readings]
    listening = [each for each in definitions if each.features == "silence"]
    strides = strides_of(backbone, first.stages)
    skip, done = first.warmup_of(n_windows), 0
    totals = {reading.name: _Tally(reading, skip, strides, keep) for reading in readings}
    for chunk, pooled in paired(backbone, chunks, definitions, device):
        (height, width), windows = chunk.shape[-2:], len(chunk)
        silent = {}
        if listening:
            silent = silence.responses(listening, (height, width), done, windows)
        for tally in totals.values():
            tally.add(pooled, silent, skip)
        if watch is not None and windows > skip:
            watch({maps: [stage[skip:] for stage in stages] for maps, stages in pooled.items()})
        skip, done = max(0, skip - windows), done + windows
    by_reading = {name: tally.scores() for name, tally in totals.items()}
    candidates = len(next(iter(by_reading.values())))
    return [
        {name: scores[index] for name, scores in by_reading.items()} for index in range(candidates)
    ]


def score_streams(
    backbone: TappedBackbone,
    reference: StreamOrHistograms,
    candidates: Sequence[StreamOrHistograms],
    readings: Sequence[Reading],
    *,
    start_us: int | None = None,
    stop_us: int | None = None,
    chunk_windows: int | None = None,
    silence: Silence | None = None,
    watch: Watcher | None = None,
    keep: Sequence[int] = (),
    device: torch.device | str = "cpu",
) -> list[dict[str, StreamScore]]:
    """Cut streams into their common windows and score the candidates against the reference.

    Args:
        backbone: the judge's network.
        reference: real stream, or its histograms of shape (windows, 2 * bins, height, width).
        candidates: streams of the same kind, sensor and clock.
        readings: readings that share one pass, see `Definition.one_pass`.
        start_us: start of the first window; by default where all streams have begun.
        stop_us: time that no window may pass; by default where the first stream ends.
        chunk_windows: windows per pass; chosen from the sensor size if None.
        silence: the judge's responses to nothing, as far as they are known.
        watch: sees the same features.
        keep: numbers of windows whose maps are kept.
        device: where the backbone lives.

    Returns:
        For each candidate the scores by name of the reading.

    Raises:
        ValueError: sensors or shapes differ, or the streams do not share a whole window.
    """
    chunks, windows = group_chunks(
        [reference, *candidates],
        _shared_pass(readings),
        start_us=start_us,
        stop_us=stop_us,
        chunk_windows=chunk_windows,
    )
    return score_group(
        backbone, chunks, windows, readings, silence=silence, watch=watch, keep=keep, device=device
    )


def score_tensors(
    backbone: TappedBackbone,
    reference: Tensor,
    candidate: Tensor,
    reading: Reading,
    *,
    silence: Silence | None = None,
    device: torch.device | str = "cpu",
) -> Tensor:
    """The score of one candidate's histograms, with gradients with respect to both.

    Args:
        backbone: the judge's network, frozen or not.
        reference: histograms, shape (windows, 2 * bins, height, width).
        candidate: histograms of the same shape.
        reading: what is compared and how.
        silence: the judge's responses to nothing, as far as they are known.
        device: where the backbone lives.

    Returns:
        The score, a scalar.

    Raises:
        ValueError: the shapes differ, or a histogram or a feature is not finite.
    """
    definition, comparison = reading.definition, Comparison(reading)
    silence = silence or Silence(backbone, device)
    chunks, windows = group_chunks([reference, candidate], definition)
    curves, done = [], 0
    for chunk, pooled in paired(backbone, chunks, [definition], device, gradients=True):
        silent = None
        if definition.features == "silence":
            (height, width), count = chunk.shape[-2:], len(chunk)
            responses = silence.responses([definition], (height, width), done, count)
            silent = responses[definition.maps]
        found = comparison.similarities(pooled, silent)
        curves.append(torch.stack([mean_over_patches(*each) for each in found], dim=-1)[:, 0])
        done += len(chunk)
    counting = torch.cat(curves)[definition.warmup_of(windows) :]
    return counting.nanmean(dim=0).nan_to_num(nan=1.0).mean()


def _shared_pass(readings: Sequence[Reading]) -> Definition:
    """The choices that all readings share, or an error where they do not."""
    shared = {reading.definition.one_pass for reading in readings}
    if len(shared) != 1 or len({reading.name for reading in readings}) < len(readings):
        raise ValueError(
            f"Expected readings of different names that differ in {', '.join(OF_A_READING)} alone, "
            f"got {[reading.name for reading in readings]} with {len(shared)} sets of other choices"
        )
    return readings[0].definition


def paired(
    backbone: TappedBackbone,
    chunks: Iterable[Tensor],
    definitions: Sequence[Definition],
    device: torch.device | str,
    *,
    gradients: bool = False,
) -> Iterator[tuple[Tensor, Pooled]]:
    """Each chunk of histograms with its pooled features."""
    first, second = itertools.tee(chunks)
    features = pooled_features(
        backbone, second, definitions=definitions, device=device, gradients=gradients
    )
    return zip(first, features, strict=True)


class _Tally:
    """Running sums of one reading over the chunks of a group of streams."""

    def __init__(
        self, reading: Reading, warmup: int, strides: Sequence[int], keep: Sequence[int] = ()
    ) -> None:
        self.comparison, self.definition = Comparison(reading), reading.definition
        self.warmup, self.keep = warmup, frozenset(keep)
        cells = self.definition.patch == "cells"
        self.strides = strides if cells else [1] * len(strides)
        self.patch_px = self.definition.patch_size * min(strides) if cells else None
        self.windows, self.kept = 0, dict[int, Tensor]()
        self.curves: list[Tensor] = []
        self.sums: list[Tensor] = []
        """By stage, for every patch, the weighted similarities and the weights, summed."""

    def add(
        self,
        pooled: Mapping[Maps, Sequence[Tensor]],
        silent: Mapping[Maps, Sequence[Tensor]],
        skip: int,
    ) -> None:
        """Compare a chunk's streams, by stage (windows, streams, channels, rows, columns).

        The chunk's first `skip` windows are warm-up and only show in the curve.
        """
        found = self.comparison.similarities(pooled, silent.get(self.definition.maps))
        curve = torch.stack([mean_over_patches(*each) for each in found], dim=-1)
        self.curves.append(curve.cpu())
        sums = [
            torch.stack([similarity * weight, weight])[:, skip:].sum(dim=1).cpu()
            for similarity, weight in found
        ]
        for index in self.keep & {*range(self.windows, self.windows + len(curve))}:
            here = [
                torch.where(weight > 0, similarity, torch.nan)[index - self.windows].cpu()
                for similarity, weight in found
            ]
            self.kept[index] = combine_maps(here, self.strides)
        self.windows += len(curve)
        before = self.sums or [torch.zeros_like(stage) for stage in sums]
        self.sums = [a + b for a, b in zip(before, sums, strict=True)]

    def scores(self) -> list[StreamScore]:
        """One score per candidate."""
        if not self.curves:
            raise ValueError("Expected at least one window, got none")
        curve = torch.cat(self.curves)
        # Where no patch counts in any window both streams are silent, and silence equals silence.
        by_stage = curve[self.warmup :].nanmean(dim=0).nan_to_num(nan=1.0)
        image = combine_maps([total / weight for total, weight in self.sums], self.strides)
        return [
            StreamScore(
                score=float(by_stage[index].mean()),
                by_stage=tuple(by_stage[index].tolist()),
                map=image[index].numpy(),
                patch_px=self.patch_px,
                curve=curve[:, index].mean(dim=-1).numpy(),
                warmup=self.warmup,
                window_maps={n: maps[index].numpy() for n, maps in sorted(self.kept.items())},
            )
            for index in range(curve.shape[1])
        ]
