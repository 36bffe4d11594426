"""What a trained detector finds in a recording, frame by frame."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import cast

import torch

from eqs.data import LabelProtocol, Recording
from eqs.drawing import Boxes
from eqs.models import Detector
from eqs.pipelines.detector import trained_detector
from eqs.pipelines.runs import Run
from eqs.training import Binning, EvaluationDataset, Selection, WindowSource, boxes_of


def detections_over(
    run: Run, recording: Recording, events_path: Path, protocol: LabelProtocol
) -> Iterator[Boxes]:
    """Detections at the second, third, ... frame, each after everything before it was seen.

    They are those that would enter the mAP of the run under the protocol, with its thresholds.

    Args:
        run: a finished training.
        recording: frame times and size.
        events_path: the events to look at, recorded or simulated.
        protocol: gives the rows that are used, the score, and whether small detections drop out.
    """
    config = run.config()
    binning = Binning(
        bins=config.datamodule.bins,
        window_us=config.datamodule.window_us,
        count_cutoff=config.datamodule.count_cutoff,
    )
    source = WindowSource(
        recording=recording, events_path=events_path, protocol=protocol, binning=binning
    )
    model = cast(Detector, trained_detector(run))
    selection = Selection(protocol, config.task.confidence_threshold, config.task.nms_threshold)
    states = None
    chunks = EvaluationDataset([source], chunk_length=10)
    for chunk in range(len(chunks)):
        with torch.no_grad():
            histograms = chunks[chunk]["histograms"].float()
            maps, states = model.forward_sequence(histograms, states)
            predictions = model.detect([stage.flatten(0, 1) for stage in maps])
        yield from map(boxes_of, selection(predictions, recording.width))
