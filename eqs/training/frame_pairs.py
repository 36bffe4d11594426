"""Pairs of consecutive frames with the numbers of events between them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import Dataset, Sampler

from eqs.data import Recording
from eqs.events import EventReader
from eqs.frames import luma
from eqs.models.volumes import BINS

Pair = tuple[Tensor, Tensor, Tensor]


class FramePairs(Dataset[Pair]):
    """Grey levels of two frames, and counts of the events in ten bins between their times.

    Args:
        recordings: with frames and events; read once, frames are kept as bytes.
        augmented: mirror half of the pairs, and change brightness and gamma of half of them, which
            leaves the contrast and so the events; by the number that `BatchNumbers` deals.
        seed: of these.
    """

    def __init__(self, recordings: Sequence[Recording], *, augmented: bool, seed: int = 0) -> None:
        """Read the frames."""
        self.recordings, self.augmented, self.seed = list(recordings), augmented, seed
        self.frames = [_grey(recording) for recording in self.recordings]
        self.readers = [
            EventReader(each.events_path, each.height, each.width) for each in self.recordings
        ]
        pairs = [(k, i) for k, own in enumerate(self.frames) for i in range(len(own) - 1)]
        self.pairs = np.array(pairs).reshape(-1, 2)

    def __len__(self) -> int:
        """How many pairs there are."""
        return len(self.pairs)

    def __getitem__(self, number: int | tuple[int, int]) -> Pair:
        """A pair, in the guise of a draw where pairs are augmented.

        Args:
            number: of the pair; with that of the draw where pairs are augmented.
        """
        draw = 0
        if isinstance(number, tuple):
            number, draw = number
        k, i = (int(each) for each in self.pairs[number])
        first, second = (self.frames[k][j].astype(np.float32) for j in (i, i + 1))
        counts = self._counts(k, i)
        if self.augmented:
            first, second, counts = _in_disguise(first, second, counts, self.seed, draw)
        seen, later = (torch.from_numpy(np.ascontiguousarray(each)) for each in (first, second))
        return seen, later, torch.from_numpy(counts.astype(np.float32))

    def mean_counts(self) -> NDArray[np.float64]:
        """Mean counts per pair, shape (20, H, W)."""
        total = sum(self._counts(int(k), int(i)) for k, i in self.pairs)
        return np.asarray(total / len(self.pairs), np.float64)

    def _counts(self, k: int, i: int) -> NDArray[np.int64]:
        recording = self.recordings[k]
        start_us, stop_us = (int(each) for each in recording.frame_times_us[i : i + 2])
        events = self.readers[k].window(start_us, stop_us)
        bins = (events.t - start_us) * BINS // (stop_us - start_us)
        height, width = recording.height, recording.width
        flat = (events.p.astype(np.int64) * BINS + bins) * height + events.y
        counted = np.bincount(flat * width + events.x, minlength=2 * BINS * height * width)
        return counted.reshape(2 * BINS, height, width)


def simplest(learned: FramePairs, judged: FramePairs) -> dict[str, float]:
    """Likelihoods of counts by two guesses that do not look at frames, as a network's is measured.

    Args:
        learned: pairs that the guesses are made of.
        judged: pairs that they are measured on.

    Returns:
        `nll_constant` of one rate for all, `nll_per_pixel` of one for each pixel and polarity.
    """
    seen, counts = learned.mean_counts(), judged.mean_counts()
    sides = seen.reshape(2, BINS, *seen.shape[1:]).mean(axis=1, keepdims=True)
    rates = np.broadcast_to(sides, (2, BINS, *seen.shape[1:])).reshape(seen.shape)
    # The likelihood is linear in the counts, so their mean over pairs is all that it needs.
    guesses = {"nll_constant": np.full_like(seen, seen.mean()), "nll_per_pixel": rates}
    return {
        name: float((rate - counts * np.log(rate + 1e-6)).mean()) for name, rate in guesses.items()
    }


class BatchNumbers(Sampler[list[tuple[int, int]]]):
    """Batches of pairs, with a number for each draw, from the seed and the epoch alone.

    Args:
        pairs: how many pairs there are.
        batches: in an epoch.
        size: of a batch.
        seed: of the draws.
    """

    def __init__(self, pairs: int, batches: int, size: int, seed: int) -> None:
        """Remember the numbers; the epoch starts at 0."""
        self.pairs, self.batches, self.size, self.seed, self.epoch = pairs, batches, size, seed, 0

    def set_epoch(self, epoch: int) -> None:
        """Which epoch is dealt next; Lightning says it."""
        self.epoch = epoch

    def __len__(self) -> int:
        """Batches of an epoch."""
        return self.batches

    def __iter__(self) -> Iterator[list[tuple[int, int]]]:
        """The batches of the epoch."""
        random = np.random.default_rng([self.seed, self.epoch])
        for batch in range(self.batches):
            first = (self.epoch * self.batches + batch) * self.size
            chosen = random.integers(0, self.pairs, self.size)
            yield [(int(pair), first + k) for k, pair in enumerate(chosen)]


def _grey(recording: Recording) -> NDArray[np.uint8]:
    parts = [images for images, _ in recording.frames()]
    images = np.concatenate(parts)
    grey: NDArray[np.uint8] = luma(images) if images.ndim == 4 else images
    return grey


def _in_disguise(
    first: NDArray[np.float32],
    second: NDArray[np.float32],
    counts: NDArray[np.int64],
    seed: int,
    draw: int,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int64]]:
    random = np.random.default_rng([seed, draw])
    mirror, change = random.random(2) < 0.5
    gain, gamma = random.uniform(0.8, 1.2), random.uniform(0.9, 1.1)
    if mirror:
        first, second, counts = first[:, ::-1], second[:, ::-1], counts[..., ::-1]
    if change:
        first, second = (
            np.minimum(255 * gain * (each / 255) ** gamma, 255).astype(np.float32)
            for each in (first, second)
        )
    return first, second, counts
