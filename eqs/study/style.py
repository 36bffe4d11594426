"""How figures look, and how they reach the disk: as PNG for the report, as SVG for papers."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from eqs.study.report import ReportFigure
from eqs.study.tables import REFERENCE

DARKER = "#d7301f"
"""Events of pixels that became darker, as in the paper."""

BRIGHTER = "#2c5fd1"
"""Events of pixels that became brighter, as in the paper."""

# Okabe and Ito's palette, told apart by nearly everyone, then some for large studies; black is kept
# for the real sensor.
PALETTE = (
    "#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#b8a800", "#7f7f7f",
    "#7b3294", "#5b3a1e",
)  # fmt: skip
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*", "<", ">")
REAL_COLOUR = "#000000"
STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e6e6e6",
    "legend.frameon": False,
    "svg.hashsalt": "eqs",
    "figure.facecolor": "white",
}

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
    "scores_by_sequence": (
        "EQS of every test sequence",
        "Each dot is one test sequence, each black tick the mean; thin lines join the same "
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


def figure(width: float, height: float) -> Figure:
    """An empty figure that fits its parts by itself and belongs to no window; sizes in inches."""
    return Figure(figsize=(width, height), layout="constrained")


def colours(systems: Iterable[str]) -> dict[str, str]:
    """One colour per system, whatever the order they come in; black for the real sensor."""
    others = sorted({*systems} - {REFERENCE})
    drawn = {name: PALETTE[at % len(PALETTE)] for at, name in enumerate(others)}
    return {**drawn, REFERENCE: REAL_COLOUR}


def save_figure(drawing: Figure, folder: Path | str, name: str) -> Path:
    """Write `<name>.png` and `<name>.svg`, each only under its name when complete.

    Returns:
        Path of the PNG.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for kind in ("svg", "png"):
        path = folder / f"{name}.{kind}"
        partial = folder / f"{path.name}.{os.getpid()}.partial"
        undated = {"Date": None} if kind == "svg" else {"Software": None}
        try:
            with mpl.rc_context(STYLE):
                drawing.savefig(
                    partial, format=kind, dpi=150, bbox_inches="tight", metadata=undated
                )
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)
    return path


def report_figure(drawing: Figure, folder: Path | str, name: str, note: str = "") -> ReportFigure:
    """Save a figure and give it the heading and caption of its name, a note appended.

    Raises:
        ValueError: no text is known for the name.
    """
    if name not in FIGURE_TEXTS:
        raise ValueError(f"Expected a figure among {sorted(FIGURE_TEXTS)}, got {name!r}")
    title, caption = FIGURE_TEXTS[name]
    return ReportFigure(title, f"{caption} {note}".strip(), save_figure(drawing, folder, name))
