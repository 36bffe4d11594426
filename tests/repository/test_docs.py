"""The examples of the documents run."""

import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.optim import SGD
from torch.optim.lr_scheduler import ConstantLR

from eqs.data import LabelProtocol
from eqs.models import RVTDetector
from eqs.training import DetectionTask

DOCS = Path(__file__).parents[2] / "docs"
PAGE = DOCS / "simulators.md"


FRAMES = np.array([[[100, 100, 100]], [[100, 140, 60]]], np.uint8)


def example(number):
    """What an example of the page on simulators defines."""
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    made = {"__name__": "document"}
    exec(blocks[number], made)
    return made


def test_the_example_network_fires_where_it_expects_events():
    events = example(0)["simulator"].simulate(FRAMES, [0, 50_000])
    assert set(zip(events.x.tolist(), events.p.tolist(), strict=True)) == {(1, 1), (2, 0)}


def test_the_example_simulator_fires_at_frames():
    made = example(1)
    events = made["FrameDifference"]().simulate(FRAMES, [0, 50_000])
    assert events.t.tolist() == [50_000, 50_000]
    assert (events.x.tolist(), events.p.tolist()) == ([1, 2], [1, 0])


def checkpoint(record) -> dict:
    """What a training of a tiny detector keeps."""
    model = RVTDetector("tiny", num_classes=2, in_channels=4, partition_split_32=1)
    protocol = LabelProtocol(name="two", classes={"car": [2], "pedestrian": [0]})
    parts = partial(SGD, lr=0.1), partial(ConstantLR), protocol
    task = DetectionTask(model, *parts, record=record).eval()
    task.detect(
        {
            "histograms": torch.zeros(1, 1, 4, 30, 40),
            "first": torch.tensor([True]),
            "labelled": torch.tensor([[False]]),
        }
    )
    kept = {"state_dict": task.state_dict(), "global_step": 0}
    task.on_save_checkpoint(kept)
    return kept


@pytest.mark.filterwarnings("ignore:.*LeafSpec.*:FutureWarning")
def test_a_checkpoint_is_loaded_and_exported_as_the_page_shows(tmp_path, monkeypatch):
    section = (DOCS / "detector.md").read_text().partition("## A checkpoint in plain PyTorch")[2]
    blocks = re.findall(r"```python\n(.*?)```", section, re.DOTALL)
    shape = {"size": "tiny", "num_classes": 2, "in_channels": 4, "partition_split_32": 1}
    settings = {"_target_": "eqs.models.RVTDetector", **shape}
    record = {"model": settings, "bins": 2, "window_us": 50_000, "count_cutoff": 10}
    torch.save(checkpoint(record), tmp_path / "weights.ckpt")
    published = {f"mdl.{k}": x for k, x in RVTDetector(num_classes=3).state_dict().items()}
    torch.save({"state_dict": published}, tmp_path / "rvt-s.ckpt")
    monkeypatch.chdir(tmp_path)
    made = {"__name__": "document"}
    for block in blocks:
        exec(block, made)
    size = made["size"]
    assert (size.height, size.width, size.class_names) == (30, 40, ("car", "pedestrian"))
    again, _ = made["detector"](made["histogram"], made["detector"].start())
    torch.testing.assert_close(made["predictions"], again, rtol=0, atol=1e-5)
    assert made["published"].model.size == "small"
