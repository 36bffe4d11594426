"""Histograms on disk, so that events are read and binned once instead of once an epoch."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import h5py
import hdf5plugin
import numpy as np
from numpy.typing import NDArray

from eqs.files import complete_file


def cached_histogram(
    path: Path, make: Callable[[], NDArray[np.uint8]], shape: tuple[int, int, int]
) -> NDArray[np.uint8]:
    """The histogram stored at `path`, made and stored if it is not there.

    Any number of processes may ask for the same one at once: each that misses it writes a file of
    its own and gives it the name when it is complete.

    Args:
        path: one file for each histogram; its folder is made if need be.
        make: gives the histogram.
        shape: what its shape must be.

    Raises:
        OSError: the file cannot be written.
        ValueError: the file is damaged, or holds another shape or type.

    Example:
        >>> import tempfile
        >>> counts = np.arange(8, dtype=np.uint8).reshape(2, 2, 2)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = Path(folder) / "50000.h5"
        ...     _ = cached_histogram(path, lambda: counts, (2, 2, 2))
        ...     bool((cached_histogram(path, lambda: counts + 1, (2, 2, 2)) == counts).all())
        True
    """
    if path.exists():
        return _read(path, shape)
    histogram = make()
    try:
        _write(path, histogram)
    except OSError as error:
        raise OSError(
            f"Expected to store a histogram at {path}, got: {error}; make room, or set "
            "datamodule.histogram_cache to another folder or to null"
        ) from error
    return histogram


def _read(path: Path, shape: tuple[int, int, int]) -> NDArray[np.uint8]:
    try:
        with h5py.File(path) as file:
            histogram = file["histogram"][()]
    except (OSError, KeyError) as error:
        raise ValueError(
            f"Expected a stored histogram at {path}, got: {error}; delete the file"
        ) from error
    if histogram.shape != shape or histogram.dtype != np.uint8:
        raise ValueError(
            f"Expected a histogram of uint8 {shape} at {path}, got {histogram.dtype} "
            f"{histogram.shape}; delete the file"
        )
    return np.asarray(histogram)


def _write(path: Path, histogram: NDArray[np.uint8]) -> None:
    # Counts rarely use more than two of their eight bits, so bit planes pack best and fastest.
    packing = hdf5plugin.Blosc(cname="lz4", clevel=5, shuffle=hdf5plugin.Blosc.BITSHUFFLE)
    with complete_file(path) as partial, h5py.File(partial, "w") as file:
        file.create_dataset("histogram", data=histogram, chunks=histogram.shape, **packing)
