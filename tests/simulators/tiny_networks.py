"""Networks of random weights, in the place where a training leaves learned ones."""

import atexit
import shutil
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
import torch
from tiny_school import Teacher

from eqs.models.volumes import VolumeGenerator
from eqs.simulators import Learning


def leave_networks(learning, learned=(("a",), ("b",)), seed=0):
    """Random networks that did not learn from what the other one did."""
    for fold in range(2):
        torch.manual_seed(seed + fold)
        learning.keep(fold, VolumeGenerator(learning.width).state_dict())
    learning.finish({"teacher": learning.teacher.name, "folds": learned, "val": []})
    return learning


@cache
def tiny_learning():
    """Networks of eight channels in a folder that goes when the tests end."""
    root = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, root, ignore_errors=True)
    return leave_networks(Learning(teacher=Teacher(), root=root, width=8))


def contrast_counts(first, second):
    """A pixel that crosses levels 0.2 apart in log light, as expected counts in ten bins."""
    change = np.log(second + 1) - np.log(first + 1)
    counts = np.stack([np.maximum(-change, 0), np.maximum(change, 0)]) / 0.2 / 10
    return np.repeat(counts[:, None], 10, axis=1).astype(np.float32)
