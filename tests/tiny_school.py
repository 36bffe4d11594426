"""A data set for simulators to learn from, as far as its name goes."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Teacher:
    """A data set by its name and sensor."""

    name: str = "school"
    sensor_hash: str | None = "0123"
