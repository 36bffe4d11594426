"""Frames between the frames, for simulators that need denser ones than a camera takes."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from eqs.files import complete_file, file_sha256

Frame = NDArray[Any]
LOADER = 1  # raise it whenever the same file of a network gives other frames


class Interpolation(Protocol):
    """Makes frames at equal distances between two others."""

    def between(self, first: Frame, second: Frame) -> Frame:
        """Frames strictly between two, in order, shape (n, *shape of one), n from 0 up.

        Levels run from 0 to 255 and keep their fractions, whatever the frames hold.
        """
        ...

    def parameters(self) -> dict[str, Any]:
        """Everything that changes the frames, as plain values."""
        ...


@dataclass(frozen=True, kw_only=True)
class LinearInterpolation:
    """Cross-fades: what moves is shown twice, pale, instead of once in between.

    Args:
        factor: frames out per frame in.

    Raises:
        ValueError: the factor is not a whole number from 1 up.
    """

    factor: int = 10

    def __post_init__(self) -> None:
        """Check the factor."""
        require_factor(self.factor)

    def between(self, first: Frame, second: Frame) -> Frame:
        """See `Interpolation`."""
        return stacked(first, [blend(first, second, share) for share in shares(self.factor)])

    def parameters(self) -> dict[str, Any]:
        """See `Interpolation`."""
        return {"kind": "linear", **asdict(self)}


@dataclass(frozen=True, kw_only=True)
class NetworkInterpolation:
    """A network: one in a file, as FILM, Super SloMo and RIFE are published, or one of the user's.

    Args:
        network: takes two frames as float arrays (H, W) or (H, W, 3), levels 0 to 255, and the
            share of the way from the first to the second, and gives the frame there; or the path
            of a file: TorchScript, a Super SloMo checkpoint or the weights of RIFE 4.25.
        factor: frames out per frame in.
        name: what tells this network from others, where it is no file.
        made_by: the command that makes the file, for those who lack it.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the factor is not a whole number from 1 up; or, when frames are made, the file
            holds something else.
    """

    network: Callable[[Frame, Frame, float], Frame] | str | Path
    factor: int = 10
    name: str = "network"
    made_by: str | None = None

    def __post_init__(self) -> None:
        """Check the factor and the file."""
        require_factor(self.factor)
        if isinstance(self.network, str | Path) and not Path(self.network).is_file():
            remedy = "set interpolation.inner.network"
            raise FileNotFoundError(
                f"Expected a network's file at {self.network}, found none; "
                f"{f'type {self.made_by}, or {remedy}' if self.made_by else remedy}"
            )

    def between(self, first: Frame, second: Frame) -> Frame:
        """See `Interpolation`."""
        network, at = self.network, shares(self.factor)
        pair = first.astype(np.float32), second.astype(np.float32)
        if isinstance(network, str | Path):
            made = frames_by_file(Path(network))(*pair, at)
        else:
            made = [network(*pair, share) for share in at]
        return stacked(first, made)

    def parameters(self) -> dict[str, Any]:
        """See `Interpolation`."""
        known: dict[str, Any] = {"kind": "network", "factor": self.factor, "name": self.name}
        if isinstance(self.network, str | Path):
            known |= {"name": network_sha256(Path(self.network)), "loader": LOADER}
        return known


@dataclass(frozen=True, kw_only=True)
class CachedInterpolation:
    """Keeps the frames that another interpolation made, by the content of what they lie between.

    Args:
        inner: makes the frames.
        folder: where they are kept.
    """

    inner: Interpolation
    folder: str | Path

    def between(self, first: Frame, second: Frame) -> Frame:
        """See `Interpolation`."""
        digest = hashlib.sha256(json.dumps(self.parameters(), sort_keys=True).encode())
        for frame in (first, second):
            digest.update(f"{frame.dtype} {frame.shape}".encode())
            digest.update(np.ascontiguousarray(frame).tobytes())
        path = Path(self.folder) / f"{digest.hexdigest()}.npy"
        if path.is_file():
            kept: Frame = np.load(path)
            return kept
        frames = self.inner.between(first, second)
        with complete_file(path) as partial, partial.open("wb") as file:
            np.save(file, frames)
        return frames

    def parameters(self) -> dict[str, Any]:
        """Those of the inner one: where frames are kept does not change them."""
        return self.inner.parameters()


def require_factor(factor: object) -> None:
    """Refuse factors that are no whole numbers from 1 up."""
    if not isinstance(factor, int) or isinstance(factor, bool) or factor < 1:
        raise ValueError(
            f"Expected a whole number of frames per frame from 1 up, got {factor!r}; "
            "set interpolation.factor"
        )


def shares(factor: int) -> list[float]:
    """Where the frames between two lie, as shares of the way."""
    return [k / factor for k in range(1, factor)]


def blend(first: Frame, second: Frame, share: float) -> NDArray[np.float32]:
    """The weighted mean of two frames."""
    return ((1.0 - share) * first + share * second).astype(np.float32)


def stacked(like: Frame, made: list[Frame]) -> NDArray[np.float32]:
    """Frames in one array, of levels 0 to 255; `like` tells their shape where there are none."""
    frames = np.stack(made) if made else np.empty((0, *like.shape))
    return np.clip(frames, 0, 255).astype(np.float32)


def network_sha256(path: Path) -> str:
    """Digest of a network's file, read once: the cache asks for it with every pair of frames."""
    return _sha256(path, *_times(path))


def frames_by_file(path: Path) -> Callable[[Frame, Frame, Sequence[float]], list[Frame]]:
    """The network of a file as a function of frames and shares, loaded once."""
    return _loaded(path, *_times(path))


def _times(path: Path) -> tuple[int, int]:
    """What changes with a file, so that another under its name is not taken for it."""
    found = path.stat()
    return found.st_mtime_ns, found.st_size


@lru_cache(maxsize=8)
def _sha256(path: Path, *_: int) -> str:
    return file_sha256(path)


@lru_cache(maxsize=2)
def _loaded(path: Path, *_: int) -> Callable[[Frame, Frame, Sequence[float]], list[Frame]]:
    from eqs.frames.networks import network_of  # torch: only those who bring a network need it here

    return network_of(path)


def displacement_factor(largest_px: float, largest_step_px: float, most: int) -> int:
    """How many steps a displacement takes if none may be larger than another, at most `most`.

    Example:
        >>> [displacement_factor(d, 1.0, 64) for d in (0.0, 1.0, 2.5, 900.0)]
        [1, 1, 3, 64]
    """
    return min(max(1, math.ceil(largest_px / largest_step_px)), most)
