"""The event camera that a command looks through: the data set's own, or another that was chosen."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from hydra.utils import instantiate
from omegaconf import DictConfig, OmegaConf

from eqs.data import Dataset

SENSORS = Path(__file__).parents[1] / "configs" / "sensor"
CHOSEN = "data.generator.other_sensor"
UNNAMED = "own"  # a camera that is none of this package's
OTHERS = "sensors"  # folder of results that are not of the data set's own camera


class Sensor(NamedTuple):
    """An event camera by name and by the hash of its parameters, which alone identifies it."""

    name: str
    hash: str

    @property
    def label(self) -> str:
        """What folders are called."""
        return f"{self.name}-{self.hash}"

    @property
    def words(self) -> str:
        """What people read."""
        return f"{self.name} ({self.hash})"


def sensor_of(data: Dataset) -> Sensor | None:
    """The camera whose events a rendered data set shows; None where a real one recorded them."""
    found = data.sensor_hash
    return None if found is None else named(found)


def named(sensor_hash: str) -> Sensor:
    """A camera by its hash; a configuration that was changed has no name any more."""
    return Sensor(_names().get(sensor_hash, UNNAMED), sensor_hash)


def other_sensor(cfg: DictConfig) -> Sensor | None:
    """The camera that was chosen; None where that is the data set's own, or none is chosen."""
    chosen = OmegaConf.select(cfg, CHOSEN)
    if chosen is None:
        return None
    found, own = (instantiate(each) for each in (chosen, cfg.data.generator.sensor))
    if found.definition_hash() == own.definition_hash():
        return None
    return named(found.definition_hash())


def sensor_label(cfg: DictConfig) -> str:
    """The label of the camera that was chosen; empty where that is the data set's own."""
    other = other_sensor(cfg)
    return "" if other is None else other.label


def check_sensor(cfg: DictConfig) -> None:
    """Refuse a choice that changes nothing.

    Raises:
        ValueError: the data have no camera to choose.
    """
    if cfg.get("sensor") is None or OmegaConf.select(cfg, CHOSEN) is not None:
        return
    name = OmegaConf.select(cfg, "data.name")
    raise ValueError(
        f"Expected data whose event camera can be chosen, got sensor for data={name}, whose events "
        "are as they were recorded; set data=dsec_mini, or leave sensor away"
        if name
        else "Expected a data set whose event camera can be chosen, got sensor without one; set "
        "data=dsec_mini, or leave sensor away"
    )


def require_events(data: Dataset, sensor: Sensor) -> None:
    """See that the events of a chosen camera were made, which a check does not do.

    Raises:
        ValueError: they were not.
    """
    loaded = [data.load(each) for held in data.sequences().values() for each in held]
    missing = [each.name for each in loaded if not each.events_path.is_file()]
    if missing:
        raise ValueError(
            f"Expected events of {sensor.words} in {len(loaded)} recordings, found none in "
            f"{len(missing)} ({', '.join(missing[:3])}...), as they are made on first use; type "
            "python scripts/prepare.py with the same data and sensor first"
        )


def own_events(cfg: DictConfig) -> DictConfig:
    """The same configuration with the data set's own camera; what `sim` names stays as it is.

    It is what a training depends on that sees no real events: frames, labels and simulator.
    """
    if OmegaConf.select(cfg, CHOSEN) is None:
        return cfg
    changes: dict[str, Any] = {"sensor": None, "data": {"generator": {"other_sensor": None}}}
    if "sim" in cfg:  # which may learn from the chosen camera
        changes["sim"] = OmegaConf.to_container(cfg.sim, resolve=True)
    merged = OmegaConf.merge(cfg, changes)
    assert isinstance(merged, DictConfig)
    return merged


def results_folder(cfg: DictConfig) -> Path:
    """Where results on the configured data go, those of another camera in a folder of their own."""
    folder, label = Path(cfg.paths.results) / str(cfg.data.name), sensor_label(cfg)
    return folder / OTHERS / label if label else folder


@cache
def _names() -> dict[str, str]:
    """The cameras of this package: names by hash."""
    found = {}
    for path in sorted(SENSORS.glob("*.yaml")):
        found[instantiate(_read(path)).definition_hash()] = path.stem
    return found


def _read(path: Path) -> DictConfig:
    """A camera's parameters, over those of the cameras that it builds on."""
    own = OmegaConf.load(path)
    assert isinstance(own, DictConfig)
    bases = [name for name in own.pop("defaults", []) if name != "_self_"]
    merged = OmegaConf.merge(*(_read(path.with_name(f"{name}.yaml")) for name in bases), own)
    assert isinstance(merged, DictConfig)
    return merged
