"""Any network that gives expected counts of events between two frames, as a simulator."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from eqs.files import file_sha256
from eqs.frames import GreyImage
from eqs.simulators.base import Simulator, require_not_negative
from eqs.simulators.learned.firing import integrate_and_fire
from eqs.simulators.pixel.randomness import draw_key, uniform_map
from eqs.simulators.streaming.pixels import Interval

Levels = NDArray[np.float32]
Counts = NDArray[np.float32]
STEADY = 1024.0
"""Expected counts are rounded to one part of this, so that last bits of a network do not show."""


@dataclass(frozen=True, kw_only=True)
class VolumeNetwork(Simulator):
    """Integrates and fires what a network expects between two frames.

    The network gives expected numbers of events in equal bins of the interval, for each polarity
    and pixel, see `integrate_and_fire`. A network that gives normalised volumes needs a scale of
    its own first. Where counts were split linearly over two bins, as in soft voxel grids, events
    come as late or early as half a bin.

    Args:
        network: takes two frames as float arrays (H, W), levels 0 to 255, and gives counts of shape
            (2, bins, H, W), OFF first; or the path of a TorchScript file that takes two tensors
            (1, 1, H, W), levels 0 to 1, and gives (1, 2 bins, H, W), OFF first.
        network_name: what tells this network from others, where it is no file.
        learned_from: name of the data set whose events it learned from; rows that are judged by
            that very data set are marked, and do not count in a correlation.
        shortest_us: shortest interval between frames that the network is used on.
        longest_us: longest one.
        seed: of the phases at which pixels start.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: a limit is negative, or mode is faithful.

    Example:
        >>> def steady(first, second):
        ...     return np.full((2, 5, *first.shape), 0.6, np.float32)
        >>> frames = np.zeros((2, 3, 4), np.uint8)
        >>> len(VolumeNetwork(network=steady).simulate(frames, [0, 50_000])) / frames[0].size
        6.0
    """

    name: ClassVar[str] = "volumes"
    pixels: ClassVar = {}

    network: Callable[[Levels, Levels], Counts] | str | Path
    network_name: str = "network"
    learned_from: str = ""
    shortest_us: int = 0
    longest_us: int = 10_000_000
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the limits and the file."""
        super().__post_init__()
        require_not_negative(self, "shortest_us", "longest_us")
        if isinstance(self.network, str | Path) and not Path(self.network).is_file():
            raise FileNotFoundError(
                f"Expected a TorchScript file at {self.network}, found none; set sim.network"
            )

    @property
    def stochastic(self) -> bool:
        """Pixels start at random phases."""
        return True

    def caveat(self, judge: str) -> str:
        """It may have learned from the very sensor that judges it."""
        return "learned from the sensor that judges it" if self.learned_from == judge else ""

    def parameters(self) -> dict[str, Any]:
        """As of every simulator, the network by what tells it from others."""
        return {**super().parameters(), **self._network_parameters()}

    def _network_parameters(self) -> dict[str, Any]:
        if isinstance(self.network, str | Path):
            return {"network": file_sha256(Path(self.network)), "network_name": ""}
        return {"network": self.network_name}

    def expected(self, first: Levels, second: Levels, sequence: str, interval: Interval) -> Counts:
        """Expected counts between two frames, shape (2, bins, H, W)."""
        network = self.network
        if isinstance(network, str | Path):
            network = _scripted(Path(network), Path(network).stat().st_mtime_ns)
        return network(first, second)


class VolumePixels:
    """The last frame, and the phase of every pixel and polarity."""

    def __init__(self, model: VolumeNetwork, image: GreyImage, sequence: str) -> None:
        """Start every pixel at a phase of its own."""
        self.model, self.sequence = model, sequence
        self.before = levels_of(image)
        size = image.codes.size
        keys = [draw_key(model.seed, f"phase {side}", sequence) for side in ("off", "on")]
        self.phases = np.stack([uniform_map(key, size) for key in keys])
        self.keys = np.empty(size, np.int64)

    def advance(self, image: GreyImage, interval: Interval) -> NDArray[np.int64]:
        """Events of one interval."""
        model = self.model
        if not model.shortest_us <= interval.span_us <= model.longest_us:
            raise ValueError(
                f"Expected frames {model.shortest_us} to {model.longest_us} us apart, as the "
                f"network of {model.name} learned, got {interval.span_us} us; take other "
                "frames, or set sim.shortest_us and sim.longest_us"
            )
        before, self.before = self.before, levels_of(image)
        counts = checked(model.expected(before, self.before, self.sequence, interval), image)
        steady = np.round(counts * STEADY) / STEADY
        self.keys, count = integrate_and_fire(
            steady.reshape(2, -1, image.codes.size),
            self.phases,
            interval.start_us,
            interval.span_us,
            self.keys,
        )
        return self.keys[:count]


def levels_of(image: GreyImage) -> Levels:
    """The grey levels of an image as an array (H, W)."""
    levels: Levels = image.levels.astype(np.float32)[image.codes]
    return levels.reshape(image.height, image.width)


def checked(counts: Counts, image: GreyImage) -> NDArray[np.float64]:
    """Counts as a network should give them.

    Raises:
        ValueError: their shape or values are not those of expected counts.
    """
    shape = counts.shape
    if len(shape) != 4 or shape[0] != 2 or shape[2:] != (image.height, image.width):
        raise ValueError(
            f"Expected counts of shape (2, bins, {image.height}, {image.width}), OFF first, of the "
            f"network, got {shape}; set sim.network to one that gives them"
        )
    if not (np.isfinite(counts).all() and counts.min() >= 0):
        raise ValueError(
            "Expected counts of the network that are finite and not negative, got some from "
            f"{np.nanmin(counts):g} to {np.nanmax(counts):g}; set sim.network to another"
        )
    return counts.astype(np.float64)


@contextmanager
def one_thread() -> Iterator[None]:
    """Let torch use one thread, whose sums are the same on any number of cores."""
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with torch.inference_mode():
            yield
    finally:
        torch.set_num_threads(before)


@lru_cache(maxsize=2)
def _scripted(path: Path, _: int) -> Callable[[Levels, Levels], Counts]:
    import torch  # only those who bring a network need it here

    network = torch.jit.load(str(path), map_location="cpu").eval()

    def expected(first: Levels, second: Levels) -> Counts:
        with one_thread():
            frames = [torch.from_numpy(levels)[None, None] / 255.0 for levels in (first, second)]
            counts: Counts = network(*frames)[0].numpy()
        return counts.reshape(2, -1, *first.shape)

    return expected


VolumeNetwork.pixels = {"fixed": VolumePixels}
