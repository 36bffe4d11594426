"""Which of a detector's predictions count: the same ones in a mAP, a picture and a film."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from eqs.data import LabelProtocol
from eqs.drawing import Boxes
from eqs.models import Detections, postprocess


@dataclass(frozen=True)
class Selection:
    """Turns predictions into detections under a protocol.

    Args:
        protocol: which score ranks a detection, and whether small ones drop out.
        confidence_threshold: objectness times class confidence below which a box is dropped.
        nms_threshold: overlap above which the weaker of two boxes of a class is dropped.
    """

    protocol: LabelProtocol
    confidence_threshold: float = 0.001
    nms_threshold: float = 0.45

    def __call__(self, predictions: Tensor, width: int) -> list[Detections]:
        """The detections of each frame.

        Args:
            predictions: of each frame, as `Detector.detect` gives them.
            width: columns of the sensor, which the protocol's sizes are relative to.
        """
        found = postprocess(
            predictions.float(),
            self.confidence_threshold,
            self.nms_threshold,
            class_score=self.protocol.class_score,
        )
        if not self.protocol.filter_detections:
            return found
        return [self._large(each, width) for each in found]

    def _large(self, found: Detections, width: int) -> Detections:
        large = self.protocol.large_enough(found["boxes"].cpu().numpy(), width)
        kept = torch.from_numpy(large).to(found["boxes"].device)
        return {name: values[kept] for name, values in found.items()}


def boxes_of(found: Detections) -> Boxes:
    """Detections of one frame, from any device and precision, ready to be drawn."""
    return Boxes(
        corners=found["boxes"].float().cpu().numpy(),
        labels=found["labels"].cpu().numpy(),
        scores=found["scores"].float().cpu().numpy(),
    )
