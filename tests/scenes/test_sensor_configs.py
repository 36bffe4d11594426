"""Every event camera that can be chosen by name is frozen."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate

from eqs.scenes import EventSensor, FirstOrderSensor

FOLDER = Path(__file__).parents[2] / "eqs/configs"

# Written down before any score was computed with them.
FROZEN = {
    "davis346": "9bb18708551c",
    "first_order": "87f8b56c8869",
    "foreign_sensor": "5a7466f2d6aa",
    "gen4": "e7a7e3bdc42b",
    "low_light": "7befbfdf9ed3",
    "reference_sensor": "51f1ba55d567",
}


def sensor_of(name: str) -> EventSensor:
    with initialize_config_dir(str(FOLDER), version_base=None):
        return instantiate(compose(f"sensor/{name}").sensor)


def test_every_sensor_is_pinned() -> None:
    assert {path.stem for path in (FOLDER / "sensor").glob("*.yaml")} == {*FROZEN}


@pytest.mark.parametrize("name", FROZEN)
def test_sensors_are_frozen(name: str) -> None:
    assert sensor_of(name).definition_hash() == FROZEN[name]


def test_the_class_has_the_values_of_its_file() -> None:
    assert asdict(sensor_of("first_order")) == asdict(FirstOrderSensor())


def test_one_scene_looks_different_to_each() -> None:
    times = np.arange(400)[:, None, None] * 1e-3
    places = np.arange(24)[None, None, :] / 24.0
    light = 50.0 + 45.0 * np.sin(2 * np.pi * (places - 2.0 * times))
    pictures = np.repeat(light, 16, axis=1).astype(np.float32)
    counts = {name: len(sensor_of(name).start(16, 24, noise_key=(0,)).step(pictures))
              for name in FROZEN}  # fmt: skip
    assert min(counts.values()) > 1000
    assert len({*counts.values()}) == len(counts)
    assert counts["low_light"] > counts["reference_sensor"] > counts["foreign_sensor"]
