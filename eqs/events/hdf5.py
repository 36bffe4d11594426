"""HDF5 files of which some may be damaged."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import ceil, prod
from pathlib import Path

import h5py

HDF5 = b"\x89HDF\r\n\x1a\n"  # what a file begins with
# What the library raises where a file does not hold what it says.
DAMAGE = (OSError, RuntimeError, LookupError, TypeError, AttributeError, MemoryError, UnicodeError)


@contextmanager
def whole_hdf5(path: Path) -> Iterator[None]:
    """Say of a file that it is damaged, in place of what the library says in the block.

    Raises:
        ValueError: it is.
    """
    try:
        yield
    except DAMAGE as error:
        raise ValueError(
            f"Expected a whole HDF5 file at {path}, got: {error}; replace the damaged file"
        ) from error


def require_stored(dataset: h5py.Dataset, path: Path) -> None:
    """Refuse a dataset that says more than it stores, whose memory would be taken for nothing.

    Raises:
        ValueError: it does.
    """
    if dataset.chunks is None:
        stored = dataset.id.get_storage_size() >= dataset.size * dataset.dtype.itemsize
    else:
        sides = zip(dataset.shape, dataset.chunks, strict=True)
        stored = dataset.id.get_num_chunks() >= prod(ceil(side / chunk) for side, chunk in sides)
    if not stored:
        raise ValueError(
            f"Expected {dataset.name} in {path} to be stored whole, got less than its shape "
            f"{dataset.shape}; replace the damaged file"
        )
