"""Which windows a training batch holds, as a pure function of seed, step and slot.

Nothing is remembered between steps: a training resumed at any step, read by any number of worker
processes, meets the same windows in the same order.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


def keyed_generator(seed: int, *key: str | int) -> np.random.Generator:
    """A generator of its own for every purpose and position.

    Example:
        >>> draws = [keyed_generator(0, "order", slot).random() for slot in (1, 2, 1)]
        >>> draws[0] == draws[2], draws[0] == draws[1]
        (True, False)
    """
    words = [zlib.crc32(part.encode()) if isinstance(part, str) else part for part in key]
    return np.random.default_rng([seed, *words])


@dataclass(frozen=True, kw_only=True)
class Chunk:
    """A run of consecutive windows of one recording.

    Args:
        recording: index of the recording.
        start: index of the first window.
        count: number of windows; at a recording's end fewer than a sample holds.
        first: whether recurrent states start from zero.
        stream: whether the slot plays whole recordings, one chunk after the other.
        key: what random changes to these windows are drawn from; a stream slot keeps it while it
            plays a recording, so that nothing jumps between its chunks.
    """

    recording: int
    start: int
    count: int
    first: bool
    stream: bool
    key: tuple[str | int, ...]


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """The windows of every training step.

    A stream slot plays all recordings whole, again and again, each pass in an order of its own. A
    random slot takes a run of windows from anywhere, each as likely as any other. Stream slots come
    first in a batch.

    Args:
        seed: what all draws depend on.
        window_counts: number of windows of each recording.
        batch_size: slots of all processes together, so that their number changes nothing.
        sequence_length: windows per sample.
        stream_share: share of stream slots, rounded up to whole slots.
        ends: for each recording the windows at which random samples may end, those with labels;
            all of them if None.
        rank: number of this process among those that train together.
        world_size: number of those processes.

    Raises:
        ValueError: there is nothing to sample from, or a number is too small.
    """

    seed: int
    window_counts: tuple[int, ...]
    batch_size: int
    sequence_length: int
    stream_share: float = 0.5
    ends: tuple[NDArray[np.int64], ...] | None = None
    rank: int = 0
    world_size: int = 1

    def __post_init__(self) -> None:
        """Check that every slot will find windows."""
        if not 0.0 <= self.stream_share <= 1.0:
            raise ValueError(
                f"Expected a share of streams in [0, 1], got {self.stream_share}; "
                "set recipe.stream_share"
            )
        if min(self.batch_size, self.sequence_length) < 1 or self.seed < 0:
            raise ValueError(
                "Expected batch_size and sequence_length of at least 1 and a seed of at least 0, "
                f"got {self.batch_size}, {self.sequence_length} and {self.seed}; "
                "set recipe.batch_size, recipe.sequence_length and seed"
            )
        if self.batch_size % self.world_size:
            raise ValueError(
                f"Expected a batch that {self.world_size} processes can share, got "
                f"{self.batch_size} samples; set recipe.batch_size or trainer.devices"
            )
        if not self.window_counts or min(self.window_counts) < 1:
            raise ValueError(
                f"Expected recordings of at least one window, got {self.window_counts}; "
                "each needs two frames or more"
            )
        if self.ends is not None and not sum(len(ends) for ends in self.ends):
            raise ValueError(
                "Expected labelled windows to train on, got none; set protocol.classes and sizes "
                "so that boxes remain, or data.root to labelled recordings"
            )

    @property
    def slots(self) -> int:
        """Slots of this process."""
        return self.batch_size // self.world_size

    @property
    def stream_slots(self) -> int:
        """Slots of the whole batch that play whole recordings; the others are random ones."""
        return math.ceil(self.stream_share * self.batch_size - 1e-9)  # 0.7 * 10 exceeds 7

    def chunk(self, step: int, position: int) -> Chunk:
        """The windows of one slot of this process's batch at one step."""
        slot = self.rank * self.slots + position
        if slot < self.stream_slots:
            return self._stream_chunk(step, slot)
        return self._random_chunk(step, slot)

    def _stream_chunk(self, step: int, slot: int) -> Chunk:
        chunks = -(-np.array(self.window_counts) // self.sequence_length)
        number, position = divmod(step, int(chunks.sum()))
        order = keyed_generator(self.seed, "order", slot, number).permutation(len(chunks))
        stops = np.cumsum(chunks[order])
        turn = int(np.searchsorted(stops, position, side="right"))
        recording = int(order[turn])
        start = int(position - stops[turn] + chunks[recording]) * self.sequence_length
        return Chunk(
            recording=recording,
            start=start,
            count=min(self.sequence_length, self.window_counts[recording] - start),
            first=start == 0,
            stream=True,
            key=("stream", slot, number, recording),
        )

    def _random_chunk(self, step: int, slot: int) -> Chunk:
        ends = self.ends or tuple(np.arange(count) for count in self.window_counts)
        stops = np.cumsum([len(each) for each in ends])
        draw = int(keyed_generator(self.seed, "random", slot, step).integers(stops[-1]))
        recording = int(np.searchsorted(stops, draw, side="right"))
        end = int(ends[recording][draw - stops[recording]])
        # A run that would begin before the recording is moved to its start; it keeps its label.
        start = max(end - self.sequence_length + 1, 0)
        return Chunk(
            recording=recording,
            start=start,
            count=min(self.sequence_length, self.window_counts[recording] - start),
            first=True,
            stream=False,
            key=("random", slot, step),
        )
