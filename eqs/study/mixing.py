"""The curve of mixing: accuracy on real events against the share of real recordings."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from eqs.drawing.style import MARKERS, REAL_COLOUR, STYLE, colours, figure
from eqs.study.tables import composed

ALONE = "real alone"


def mixing_points(study: pd.DataFrame) -> pd.DataFrame:
    """Mean real mAP and its standard deviation over seeds, by line and share of real recordings.

    Args:
        study: one row per (system, seed), with `real_share` and in words what the detector saw
            `beside` the real events and `before` them, as `evaluate` writes them.

    Returns:
        Columns `line`, `share`, `map_real`, `sd`, `seeds`, and `only`: of the simulators that occur
        in a line, their own accuracy without real events, with a share of 0.
    """
    rows = study.assign(**{name: study[name].fillna("") for name in ("beside", "before")})
    rows = rows.dropna(subset=["map_real"])
    real = rows[rows["real_share"] > 0]
    used = {*real["beside"], *real["before"]} - {""}
    only = rows[(rows["real_share"] == 0) & (rows["before"] == "") & rows["beside"].isin(used)]
    found = pd.concat([real, only])
    found["line"] = [_line(row) for row in found.to_dict("records")]
    groups = found.groupby(["line", "real_share"], sort=False)["map_real"]
    points = groups.agg(map_real="mean", sd="std", seeds="count").reset_index()
    points = points.rename(columns={"real_share": "share"})
    return points.assign(only=points["share"] == 0).sort_values(["line", "share"])


def has_mixing(study: pd.DataFrame) -> bool:
    """Whether there are detectors that saw a share of the real events, or others beside them."""
    return "real_share" in study and bool((composed(study) & (study["real_share"] > 0)).any())


def mixing_curve(study: pd.DataFrame) -> Figure:
    """Real mAP against the share of real recordings: alone, with simulated events, after them.

    Args:
        study: as `mixing_points` takes it.
    """
    points = mixing_points(study)
    lines = list(dict.fromkeys(points.loc[~points["only"], "line"]))
    colour = {**colours(points["line"]), ALONE: REAL_COLOUR}
    with mpl.rc_context(STYLE):
        drawing = figure(6.4, 4.2)
        axes = drawing.subplots()
        for at, name in enumerate(lines):
            _line_of(axes, points[points["line"] == name], MARKERS[at % len(MARKERS)], colour[name])
        for _, row in points[points["only"]].iterrows():
            axes.axhline(
                100 * row["map_real"], color=colour[row["line"]], linestyle="--", label=row["line"]
            )
        shares = np.unique(points.loc[~points["only"], "share"])
        axes.set_xscale("log")
        axes.set_xticks(100 * shares, [f"{100 * share:g}" for share in shares])
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set(
            xlabel="real training recordings, %", ylabel="mAP on real events (higher is better)"
        )
        axes.margins(y=0.12)
        axes.set_ylim(bottom=0)
        drawing.legend(*axes.get_legend_handles_labels(), loc="outside upper left", ncols=2)
    return drawing


def _line_of(axes: Axes, points: pd.DataFrame, marker: str, colour: str) -> None:
    axes.errorbar(
        100 * points["share"],
        100 * points["map_real"],
        yerr=100 * points["sd"].fillna(0) if points["seeds"].max() > 1 else None,
        color=colour,
        marker=marker,
        capsize=3,
        label=points["line"].iloc[0],
    )


def _line(row: Mapping[Hashable, Any]) -> str:
    if not row["real_share"]:
        return f"{row['beside']} only"
    words = f"real and {row['beside']}" if row["beside"] else "real"
    if row["before"]:
        return f"{row['before']}, then {words}"
    return words if row["beside"] else ALONE
