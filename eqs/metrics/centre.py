"""Mean and covariance of real features, which centre and whiten a score: half of a judge."""

from __future__ import annotations

import hashlib
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from eqs.files import complete_file
from eqs.metrics.definition import Definition
from eqs.metrics.features import TappedBackbone, pooled_features
from eqs.metrics.similarity import whitening_matrix
from eqs.metrics.windows import StreamOrHistograms, group_chunks


@dataclass(frozen=True, kw_only=True, eq=False)
class Centre:
    """Mean and covariance of the pooled features of real streams: half of a judge.

    Like the statistics of a Fréchet distance they are computed once, over the judge's own real
    training recordings, and stored with their hash; never from the pair being scored.

    Args:
        tap: activation the mean was taken of.
        stages: stages, counted from 1.
        means: mean feature of each stage, float32, shape (channels,).
        covariances: covariance of each stage, float32, shape (channels, channels), which only
            whitened features need; none in a centre of means alone.
        patches: patch vectors averaged, over all stages.
        features_hash: `Definition.features_hash` of the features; empty where nobody noted it.
        recordings: hash of what the recordings hold; empty where nobody noted it.

    Raises:
        ValueError: there is not one mean, and one covariance or none, for each stage.
    """

    tap: str
    stages: tuple[int, ...]
    means: tuple[NDArray[np.float32], ...]
    covariances: tuple[NDArray[np.float32], ...] = ()
    patches: int = 0
    features_hash: str = ""
    recordings: str = ""

    def __post_init__(self) -> None:
        """Check that every stage has its statistics."""
        counts = len(self.stages), len(self.means), len(self.covariances)
        if counts[0] != counts[1] or counts[2] not in (0, counts[0]):
            raise ValueError(
                f"Expected a mean and a covariance, or no covariances, for {counts[0]} stages, "
                f"got {counts[1]} and {counts[2]}"
            )

    @property
    def sha256(self) -> str:
        """Hash of the tap, the stages and the statistics; independent of the file's bytes."""
        digest = hashlib.sha256(f"{self.tap} {self.stages}".encode())
        for array in (*self.means, *self.covariances):
            digest.update(np.ascontiguousarray(array, dtype="<f4").tobytes())
        return digest.hexdigest()

    def save(self, path: Path | str) -> None:
        """Write an npz file; it appears under its name only when it is complete."""
        arrays: dict[str, Any] = {}
        for name, statistics in (("stage", self.means), ("covariance", self.covariances)):
            arrays |= {f"{name}_{k}": a for k, a in zip(self.stages, statistics, strict=False)}
        arrays |= {"tap": self.tap, "patches": self.patches}
        arrays |= {"features_hash": self.features_hash, "recordings": self.recordings}
        with complete_file(path) as partial, partial.open("wb") as file:
            np.savez(file, sha256=self.sha256, **arrays)

    @classmethod
    def load(cls, path: Path | str) -> Centre:
        """Read what `save` wrote, or a file of means alone from before there were covariances.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: the file is no centre, or its statistics do not match its hash.
        """
        source = Path(path)
        if not source.is_file():
            raise FileNotFoundError(f"Expected a centre at {source}, got no file; set eqs.judge")
        try:
            with source.open("rb") as file, np.load(file, allow_pickle=False) as data:
                stages = tuple(sorted(int(key[6:]) for key in data if key.startswith("stage_")))
                means = tuple(data[f"stage_{stage}"] for stage in stages)
                spreads = (f"covariance_{stage}" for stage in stages)
                covariances = tuple(data[name] for name in spreads if name in data)
                tap, patches, stored = str(data["tap"]), int(data["patches"]), str(data["sha256"])
                noted = {n: str(data[n]) for n in ("features_hash", "recordings") if n in data}
        except (KeyError, ValueError, OSError, EOFError, zipfile.BadZipFile) as error:
            raise ValueError(
                f"Expected a centre written by this package at {source}, got {error}; "
                "delete it to have it computed again"
            ) from error
        centre = cls(
            tap=tap,
            stages=stages,
            means=means,
            covariances=covariances,
            patches=patches,
            **noted,
        )
        if centre.sha256 != stored:
            raise ValueError(
                f"Expected the centre at {source} to match its hash, got other values; "
                "delete it to have it computed again"
            )
        return centre

    def for_stages(self, stages: Sequence[int]) -> tuple[Tensor, ...]:
        """The means of some stages as tensors.

        Raises:
            ValueError: the centre lacks a stage.
        """
        missing = sorted({*stages} - {*self.stages})
        if missing:
            raise ValueError(
                f"Expected a centre of stages {tuple(stages)}, got one of {self.stages}; "
                "set eqs.judge or eqs.stages"
            )
        return tuple(torch.from_numpy(self.means[self.stages.index(stage)]) for stage in stages)

    def whitening(self, stages: Sequence[int]) -> tuple[Tensor, ...]:
        """Matrices that whiten the features of some stages, for a centre with covariances.

        Raises:
            ValueError: the features of a stage do not vary.
        """
        covariances = (self.covariances[self.stages.index(stage)] for stage in stages)
        return tuple(whitening_matrix(torch.from_numpy(each)) for each in covariances)


def feature_centres(
    backbone: TappedBackbone,
    recordings: Iterable[StreamOrHistograms],
    *,
    taps: Sequence[str],
    definition: Definition,
    chunk_windows: int | None = None,
    device: torch.device | str = "cpu",
) -> dict[str, Centre]:
    """Mean and covariance of the pooled features of real recordings by tap, after the warm-ups.

    Convention: every patch of every window counts once, so long recordings weigh more.

    Args:
        backbone: the judge's network.
        recordings: real streams, or their histograms of shape (windows, 2 * bins, height, width).
        taps: activations to average; all come from one pass.
        definition: stages, patches, binning and warm-up of the score to be centred or whitened.
        chunk_windows: windows per pass; chosen from the sensor size if None.
        device: where the backbone lives.

    Raises:
        ValueError: there is no recording, or a feature is not finite.
    """
    sums = {tap: [_Moments() for _ in definition.stages] for tap in taps}
    by_tap = {tap: replace(definition, tap=tap, mask="none") for tap in taps}
    for recording in recordings:
        chunks, windows = group_chunks([recording], definition, chunk_windows=chunk_windows)
        skip = definition.warmup_of(windows)
        for pooled in pooled_features(
            backbone,
            chunks,
            definitions=[*by_tap.values()],
            device=device,
        ):
            for tap, each in by_tap.items():
                for running, stage in zip(sums[tap], pooled[each.maps], strict=True):
                    running.add(stage[skip:])
            skip = max(0, skip - len(next(iter(pooled.values()))[0]))
    return {
        tap: Centre(
            tap=tap,
            stages=definition.stages,
            means=tuple(running.mean() for running in by_stage),
            covariances=tuple(running.covariance() for running in by_stage),
            patches=sum(running.count for running in by_stage),
            features_hash=definition.features_hash,
        )
        for tap, by_stage in sums.items()
    }


class _Moments:
    """Running moments of the channels of maps (windows, streams, channels, rows, columns)."""

    def __init__(self) -> None:
        self.total = self.products = torch.zeros((), dtype=torch.float64)
        self.count = 0

    def add(self, maps: Tensor) -> None:
        exact = maps.double()
        self.total = self.total + exact.sum(dim=(0, 1, 3, 4)).cpu()
        self.products = self.products + torch.einsum("tschw,tsdhw->cd", exact, exact).cpu()
        self.count += maps.numel() // maps.shape[2]

    def mean(self) -> NDArray[np.float32]:
        if not self.count:
            raise ValueError("Expected at least one real recording to centre on, got none")
        mean = (self.total / self.count).float().numpy()
        if not np.isfinite(mean).all():
            raise ValueError("Expected finite features, got NaN or infinity; set eqs.judge")
        return mean

    def covariance(self) -> NDArray[np.float32]:
        mean = self.total / self.count
        return (self.products / self.count - torch.outer(mean, mean)).float().numpy()
