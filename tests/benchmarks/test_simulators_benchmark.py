"""The simulators' benchmark times whole runs, on a clip of its own or a given one."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from eqs.benchmarks.simulators import (
    PERIOD_US,
    Job,
    configured,
    draw_clip,
    light_milliseconds,
    measure,
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Images of six frames."""
    for index, frame in enumerate(draw_clip(6, 40, 48, seed=3)):
        Image.fromarray(frame).save(tmp_path / f"{index:02d}.png")
    return tmp_path


def test_a_folder_stands_in_for_the_drawn_clip(folder: Path) -> None:
    assert np.array_equal(Job("ESIM", 0.2, 6, (1, 1), folder).clip(), draw_clip(6, 40, 48, seed=3))
    assert len(Job("ESIM", 0.2, 4, (1, 1), folder).clip()) == 4
    assert Job("ESIM", 0.2, 6, (32, 40)).clip().shape == (6, 32, 40)


def test_the_events_counted_are_those_of_the_whole_clip(folder: Path) -> None:
    frames, events, cost = measure(Job("ESIM", 0.05, 60, (1, 1), folder))
    clip, times_us = draw_clip(6, 40, 48, seed=3), PERIOD_US * np.arange(6)
    assert (frames, events) == (6, len(configured("ESIM", 0.05).simulate(clip, times_us)))
    assert cost.seconds > 0


def test_a_network_that_learned_nothing_is_timed_as_one_that_did() -> None:
    simulator = configured("EventGAN", 0.2)
    clip = draw_clip(3, 32, 40)
    assert len(simulator.simulate(clip, PERIOD_US * np.arange(3))) > 0


def test_light_costs_a_table() -> None:
    plain, linear = light_milliseconds(draw_clip(1, 32, 40)[0], repeats=3)
    assert 0 < plain < 50
    assert 0 < linear < 50
