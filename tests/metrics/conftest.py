"""Small streams and a small recurrent backbone for the metric tests."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import torch
from torch import nn

from eqs.events import Events


class SmallBackbone(nn.Module):
    """Three strided stages with a leaky state, showing what a real backbone shows."""

    strides = (2, 4, 8)

    def __init__(self, bins=2, channels=6, seed=0):
        super().__init__()
        generator = torch.Generator().manual_seed(seed)
        widths = [2 * bins, channels, 2 * channels, 4 * channels]
        self.convolutions = nn.ModuleList(
            nn.Conv2d(before, after, 2, stride=2) for before, after in itertools.pairwise(widths)
        )
        for parameter in self.parameters():
            parameter.data = torch.randn(parameter.shape, generator=generator) * 0.4
        self.calls = 0

    def taps(self, x, states, stages=(1, 2, 3), names=("hidden",)):
        self.calls += 1
        steps, streams, _, height, width = x.shape
        x = nn.functional.pad(x, (0, -width % 8, 0, -height % 8)).flatten(0, 1)
        maps = {name: [] for name in names}
        new_states = []
        for index, convolution in enumerate(self.convolutions[: max(stages)]):
            down = convolution(x).unflatten(0, (steps, streams))
            hidden = states[index] if states else torch.zeros_like(down[0])
            history = []
            for step in down:
                hidden = 0.5 * hidden + 0.5 * torch.tanh(step)
                history.append(hidden)
            sequence = torch.stack(history)
            shown = {"hidden": sequence, "gate": torch.sigmoid(sequence), "downsample": down}
            if index + 1 in stages:
                for name in names:
                    maps[name].append(shown[name])
            new_states.append(hidden)
            x = sequence.flatten(0, 1)
        return maps, new_states


def random_events(seed, count=4000, height=20, width=28, start_us=0, stop_us=1_000_000):
    generator = np.random.default_rng(seed)
    return Events.from_arrays(
        t=np.sort(generator.integers(start_us, stop_us, count)),
        x=generator.integers(0, width, count),
        y=generator.integers(0, height, count),
        p=generator.integers(0, 2, count),
        height=height,
        width=width,
    )


@pytest.fixture
def make_events():
    return random_events


@pytest.fixture
def make_backbone():
    return SmallBackbone


@pytest.fixture
def backbone():
    return SmallBackbone()
