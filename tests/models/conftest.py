"""Reference data of the published detector, and weights that follow from names alone."""

import zlib
from pathlib import Path

import numpy as np
import pytest
import torch

from eqs.models import RVTDetector

GOLDEN = Path(__file__).parents[1] / "golden" / "rvt"


def filled_value(name, shape):
    """The value that the reference data give to an entry of the state dict.

    A standard normal draw seeded by the CRC-32 of the name, scaled by kind: kernels by
    1.8/sqrt(fan in), matrices by 1/sqrt(fan in), scales around 1, biases around 0.
    """
    kind = name.rsplit(".", 1)[-1]
    if kind == "num_batches_tracked":
        return np.zeros(shape, np.int64)
    draw = np.random.RandomState(zlib.crc32(name.encode())).standard_normal(tuple(shape))
    if kind == "running_var":
        value = 1 + 0.1 * np.abs(draw)
    elif kind == "running_mean":
        value = 0.1 * draw
    elif len(shape) >= 2:
        value = (1.8 if len(shape) == 4 else 1.0) * draw / np.sqrt(np.prod(shape[1:]))
    elif kind in ("weight", "gamma"):
        value = 1 + 0.1 * draw
    else:
        value = 0.05 * draw
    return np.asarray(value).astype(np.float32)


@pytest.fixture(scope="session")
def fill_rule():
    """The function behind `filled`: name and shape to value."""
    return filled_value


@pytest.fixture(scope="session")
def filled():
    """Build detectors with the reference weights."""

    def build(size, **options):
        model = RVTDetector(size, partition_split_32=1, **options)
        with torch.no_grad():
            for name, tensor in model.state_dict().items():
                tensor.copy_(torch.from_numpy(filled_value(name, tensor.shape)))
        return model

    return build


@pytest.fixture(scope="session")
def golden():
    """Load one file of reference data as tensors."""

    def load(name):
        with np.load(GOLDEN / f"{name}.npz") as file:
            return {
                key: torch.from_numpy(file[key]) if file[key].dtype.kind != "U" else file[key]
                for key in file.files
            }

    return load


@pytest.fixture(autouse=True)
def one_thread():
    """Tests of a shared machine stay on one core."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)
