"""What a detector reached on one event stream."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

from torch import Tensor


@dataclass(frozen=True, kw_only=True)
class Accuracy:
    """Mean average precision, overall and by class, as COCO counts it; -1 where nothing was there.

    Args:
        map: mean over overlaps from .5 to .95.
        map_50: at an overlap of .5.
        map_75: at an overlap of .75.
        map_small: of boxes below 32 x 32 pixels.
        map_medium: of boxes up to 96 x 96 pixels.
        map_large: of larger boxes.
        map_per_class: `map` by the name of the class.
        map_50_per_class: `map_50` by the name of the class.
        ground_truths_per_class: labelled boxes by the name of the class.
    """

    map: float
    map_50: float
    map_75: float
    map_small: float
    map_medium: float
    map_large: float
    map_per_class: dict[str, float]
    map_50_per_class: dict[str, float]
    ground_truths_per_class: dict[str, float]

    @classmethod
    def of(cls, values: Mapping[str, Tensor], class_names: Sequence[str]) -> Accuracy:
        """What `MeanAveragePrecision.compute` gave, with names for its classes."""
        found: dict[str, Any] = {}
        for each in fields(cls):
            value = values[each.name].float().tolist()
            listed = isinstance(value, list)
            found[each.name] = dict(zip(class_names, value, strict=True)) if listed else value
        return cls(**found)

    def scalars(self) -> dict[str, float]:
        """Every number under one name, for a logger: `map`, `map_per_class/car`."""
        flat: dict[str, float] = {}
        for name, value in asdict(self).items():
            if isinstance(value, dict):
                flat |= {f"{name}/{label}": each for label, each in value.items()}
            else:
                flat[name] = value
        return flat
