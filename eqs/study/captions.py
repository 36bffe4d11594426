"""Heading and caption of every figure in the report."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from eqs.drawing import save_figure
from eqs.study.report import ReportFigure

FIGURE_TEXTS = {
    "score_against_accuracy": (
        "EQS against accuracy on real events",
        "Each mark is one simulator: how similar its events look to real ones (EQS, to the right "
        "is better) against what a detector trained on it achieves, in four readings. If EQS "
        "foresaw the outcome perfectly, the marks would rise steadily in the upper panels and "
        "fall in the lower ones. Bars span one standard deviation over training seeds. Grey "
        "lines: the score of an unrelated scene (chance) and of a nearly identical stream "
        "(ceiling). A dashed line is the detector trained on real events. The absolute drop "
        "contains the simulated mAP, so a weak detector seems to lose little: read it last.",
    ),
    "accuracy": (
        "Accuracy on simulated and on real test events",
        "For each simulator a detector was trained on its events, then tested twice: on simulated "
        "events of the test scenes (pale) and on the real events of the same scenes (full). The "
        "distance between the two is the absolute drop. The black bar was trained on real events: "
        "it shows what is possible.",
    ),
    "mixing": (
        "What simulated events add to a few real ones",
        "Accuracy on real events against the share of the real training recordings that a detector "
        "saw: these alone, simulated events together with them, and simulated events first and "
        "then them. Dashed: simulated events only. Where the lines meet, simulated events add "
        "nothing any more. Bars span one standard deviation over training seeds.",
    ),
    "scores_by_sequence": (
        "EQS of every test sequence",
        "Each dot is one test sequence, each black tick the mean over the sequences that every "
        "simulator was scored on; thin lines join the same "
        "sequence, because simulators can be compared fairly only on the same scene. To the "
        "right is better.",
    ),
    "event_rates": (
        "Events over time",
        "How many events a pixel reports per second, for every simulator and for the real sensor "
        "(black), on the same scene. A simulator far above or below the black line is too "
        "sensitive or too dull; a comb of spikes betrays events that are tied to video frames.",
    ),
    "events": (
        "The same instant through every simulator",
        "The video frame, the real events and every simulator's events. Blue: a pixel became "
        "brighter; red: it became darker; white: it reported nothing.",
    ),
    "detections": (
        "What the detectors see in real events",
        "Every panel shows the same real events. Dashed: the true boxes. Solid: what a detector "
        "finds that was trained on the events of the simulator named above the panel, with its "
        "confidence.",
    ),
    "score_maps": (
        "Where the simulated events differ",
        "EQS of every patch of the image, averaged over the scored time, on one colour scale, "
        "beside a video frame of the scene. Bright patches look to the judge as they do in real "
        "events, dark ones do not.",
    ),
}
"""Heading and caption of every figure, for readers who have not seen the paper."""


def report_figure(drawing: Figure, folder: Path | str, name: str, note: str = "") -> ReportFigure:
    """Save a figure and give it the heading and caption of its name, a note appended.

    Raises:
        ValueError: no text is known for the name.
    """
    if name not in FIGURE_TEXTS:
        raise ValueError(f"Expected a figure among {sorted(FIGURE_TEXTS)}, got {name!r}")
    title, caption = FIGURE_TEXTS[name]
    return ReportFigure(title, f"{caption} {note}".strip(), save_figure(drawing, folder, name))
