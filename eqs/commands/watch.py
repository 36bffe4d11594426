"""Film what a trained detector finds."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from hydra.utils import instantiate

from eqs.data import Recording
from eqs.drawing import event_picture, with_boxes, write_film
from eqs.events import EventReader
from eqs.files import refuse_foreign
from eqs.pipelines.detections import detections_over
from eqs.pipelines.runs import Run


def film(
    run: Run, recording: Recording, events_path: Path, *, seconds: float, min_score: float
) -> list[np.ndarray]:
    """One picture per frame of the recording: the events before it and the boxes found."""
    config = run.config()
    protocol, window_us = instantiate(config.protocol), config.datamodule.window_us
    times_us = recording.frame_times_us[1:]
    pictures = []
    found = detections_over(run, recording, events_path, protocol)
    with EventReader(events_path, recording.height, recording.width) as events:
        for time_us, boxes in zip(times_us.tolist(), found, strict=True):
            if time_us > times_us[0] + 1e6 * seconds:
                break
            picture = event_picture(events.window(time_us - window_us, time_us))
            pictures.append(with_boxes(picture, boxes, min_score=min_score))
    return pictures


def main(arguments: Sequence[str], shown: str) -> None:
    """Read the command line and write the film."""
    parser = argparse.ArgumentParser(prog=shown, description=__doc__)
    parser.add_argument("run", type=Path, help="folder of a finished training, below runs/")
    parser.add_argument("recording", type=Path, help="folder in DSEC layout")
    parser.add_argument("out", type=Path, help=".gif, .mp4, or .png for a strip of stills")
    parser.add_argument("--events", type=Path, help="other events, for instance simulated ones")
    parser.add_argument("--seconds", type=float, default=10.0, help="from the first frame on")
    parser.add_argument("--min-score", type=float, default=0.3, help="confidence shown")
    parser.add_argument("--rate", type=float, default=20.0, help="pictures per second")
    parser.add_argument("--zoom", type=int, default=4, help="screen pixels per pixel")
    given = parser.parse_args(arguments)
    run = Run(given.run)
    if not run.finished:
        sys.exit(f"Expected a finished training in {given.run}, got none; give a folder of runs/")
    try:
        refuse_foreign(given.out)  # before the work
        recording = Recording.load(given.recording)
        pictures = film(
            run,
            recording,
            given.events or recording.events_path,
            seconds=given.seconds,
            min_score=given.min_score,
        )
        write_film(given.out, pictures, frames_per_second=given.rate, zoom=given.zoom)
    except (OSError, ValueError) as error:
        sys.exit(str(error))
    sys.stdout.write(f"{given.out}\n")
