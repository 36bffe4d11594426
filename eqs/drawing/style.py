"""How figures look, and how they reach the disk: as PNG for the report, as SVG for papers."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from eqs.files import MADE_HERE, complete_file
from eqs.names import REFERENCE

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
    for kind in ("svg", "png"):
        path = folder / f"{name}.{kind}"
        said = {"Date": None, "Creator": MADE_HERE} if kind == "svg" else {"Software": MADE_HERE}
        with complete_file(path) as partial, mpl.rc_context(STYLE):
            drawing.savefig(partial, format=kind, dpi=150, bbox_inches="tight", metadata=said)
    return path
