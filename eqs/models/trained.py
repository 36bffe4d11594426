"""A trained detector in plain PyTorch, with what its checkpoint knows of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, cast

import torch
from torch import Tensor, nn

from eqs.models.checkpoint import (
    GEOMETRY,
    RECORD,
    load_trained,
    read_content,
    read_weights,
    shape_of,
)
from eqs.models.detector import RVTDetector
from eqs.models.protocol import Detector, require_detector
from eqs.models.settings import built
from eqs.models.states import Carried, map_states

SETTINGS = "model"  # in the record: what builds the network again
PATH = "the path of load_detector"


@dataclass(frozen=True, kw_only=True)
class Geometry:
    """What a detector was trained on.

    Args:
        height: rows of the histograms.
        width: columns of the histograms.
        bins: time bins per polarity, half the channels.
        window_us: length of a window in microseconds.
        count_cutoff: events per pixel and bin at which a histogram saturates.
        class_names: name of each class, in the order of the predictions' columns.
    """

    height: int
    width: int
    bins: int
    window_us: int
    count_cutoff: int
    class_names: tuple[str, ...]


class TrainedDetector(nn.Module):
    """A detector in evaluation mode that sees one window after another, without gradients.

    Args:
        model: the network.
        geometry: what it was trained on.

    Example:
        >>> geometry = Geometry(height=32, width=32, bins=10, window_us=50_000, count_cutoff=10,
        ...                     class_names=("car", "pedestrian"))
        >>> detector = TrainedDetector(RVTDetector("tiny", partition_split_32=1), geometry)
        >>> predictions, states = detector(torch.zeros(1, 20, 32, 32), detector.start())
        >>> predictions.shape
        torch.Size([1, 21, 7])
    """

    def __init__(self, model: nn.Module, geometry: Geometry) -> None:
        """Put the network into evaluation mode."""
        super().__init__()
        require_detector(model)
        self.model, self.geometry = model, geometry
        self.eval()

    @torch.no_grad()
    def forward(self, histogram: Tensor, states: Carried = None) -> tuple[Tensor, Carried]:
        """Detect in one window of each of N streams.

        Args:
            histogram: (N, 2 * bins, H, W), any real number type.
            states: what the call before returned; None or those of `start` at the start.

        Returns:
            Predictions (N, A, 5 + classes), columns cx, cy, w, h in pixels, objectness and class
            confidences, which `postprocess` turns into boxes; and the new states.
        """
        model = cast(Detector, self.model)
        features, states = model.forward_sequence(histogram.float()[None], states)
        return model.detect([each[0] for each in features]), states

    def start(self, streams: int = 1) -> Carried:
        """The states of streams that have not begun: zeros, for programs that take no None."""
        size = self.geometry.height, self.geometry.width
        device = next((each.device for each in self.parameters()), None)
        _, states = self(torch.zeros(streams, 2 * self.geometry.bins, *size, device=device))
        return map_states(torch.zeros_like, states)


def load_detector(path: str | Path, **missing: Any) -> TrainedDetector:  # noqa: ANN401
    """The trained detector of a checkpoint: an RVT, or one of your own.

    Our trainings write into a checkpoint what the detector is and what it was trained on. Published
    files and those of older versions hold an RVT and say less.

    Args:
        path: checkpoint file.
        **missing: what the file does not say: fields of `Geometry`, and `partition_split_32`.

    Raises:
        FileNotFoundError: no such file.
        ValueError: no detector in it, something that neither the file nor the caller says or that
            both say differently, or a class that is not installed here.
    """
    content = read_content(path, PATH)
    record = dict(content.get(RECORD) or {})
    settings = record.pop(SETTINGS, None)
    model: nn.Module
    if settings is not None:
        said = _completed(record, missing, path)
        model = built(settings)
        load_trained(model, path, PATH)
    else:
        shape = shape_of(read_weights(path, PATH), path)
        known = {**record, "bins": shape.in_channels // 2, GEOMETRY: content.get(GEOMETRY)}
        said = _completed(known, missing, path)
        model = RVTDetector.from_checkpoint(path, partition_split_32=said.pop(GEOMETRY))
        if len(said["class_names"]) != shape.num_classes:
            raise ValueError(
                f"Expected {shape.num_classes} class_names, as many as {path} was trained with, "
                f"got {len(said['class_names'])}; set class_names"
            )
    return TrainedDetector(model, Geometry(**{**said, "class_names": tuple(said["class_names"])}))


def _completed(
    known: Mapping[str, Any], given: Mapping[str, Any], path: str | Path
) -> dict[str, Any]:
    """What a file knows with what the caller adds, and nothing missing."""
    names = list(dict.fromkeys([*(field.name for field in fields(Geometry)), *known]))
    said = {name: value for name, value in known.items() if value is not None}
    for name, value in given.items():
        if name not in names or said.get(name, value) != value:
            raise ValueError(
                f"Expected only what {path} does not say of {', '.join(names)}, got {name}={value}"
                f"{f' instead of {said[name]}' if name in said else ''}; leave {name} out"
            )
    missing = [name for name in names if name not in {**said, **given}]
    if missing:
        raise ValueError(
            f"Expected {', '.join(missing)} in {path}, got a file that does not say, a published "
            "one or that of an older version; give load_detector "
            f"{', '.join(f'{name}=...' for name in missing)}"
        )
    return {**said, **given}
