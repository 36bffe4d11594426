"""What a trained detector finds in a recording, frame by frame."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import torch

from eqs.data import Binning, EvaluationDataset, LabelProtocol, Recording, WindowSource
from eqs.models import Detections, RVTDetector, postprocess
from eqs.pipelines.runs import Run
from eqs.study import Boxes
from eqs.tasks import large_detections


def detections_over(
    run: Run,
    recording: Recording,
    events_path: Path,
    protocol: LabelProtocol,
    min_score: float = 0.1,
) -> Iterator[Boxes]:
    """Detections at the second, third, ... frame, each after everything before it was seen.

    Args:
        run: a finished training.
        recording: frame times and size.
        events_path: the events to look at, recorded or simulated.
        protocol: gives the rows that are used, and whether small detections drop out.
        min_score: objectness times class confidence from which on a detection counts.
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
    model = RVTDetector.from_checkpoint(
        run.weights, partition_split_32=config.model.partition_split_32
    ).eval()
    states = None
    chunks = EvaluationDataset([source], chunk_length=10)
    for chunk in range(len(chunks)):
        with torch.no_grad():
            histograms = chunks[chunk]["histograms"].float()
            maps, states = model.backbone.forward_sequence(histograms, states)
            predictions = model.detect([stage.flatten(0, 1) for stage in maps])
            found = postprocess(predictions, min_score)
        if protocol.filter_detections:
            found = [large_detections(each, protocol, recording.width) for each in found]
        yield from map(boxes_of, found)


def boxes_of(found: Detections) -> Boxes:
    """Detections of one frame, from any device and precision, ready to be drawn."""
    return Boxes(
        corners=found["boxes"].float().cpu().numpy(),
        labels=found["labels"].cpu().numpy(),
        scores=found["scores"].float().cpu().numpy(),
    )
