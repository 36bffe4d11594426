"""The example simulator of the documents runs."""

import re
from pathlib import Path

import numpy as np

PAGE = Path(__file__).parents[2] / "docs" / "simulators.md"


def test_the_example_simulator_fires_at_frames():
    (block,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    made = {"__name__": "document"}
    exec(block, made)
    frames = np.array([[[100, 100, 100]], [[100, 140, 60]]], np.uint8)
    events = made["FrameDifference"]().simulate(frames, [0, 50_000])
    assert events.t.tolist() == [50_000, 50_000]
    assert (events.x.tolist(), events.p.tolist()) == ([1, 2], [1, 0])
