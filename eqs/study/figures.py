"""Charts of a study's tables: points, bars and curves, with the good direction on every axis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from eqs.drawing.style import MARKERS, STYLE, colours, figure
from eqs.names import REFERENCE
from eqs.study.correlation import SIMULATORS_NEEDED, Correlation
from eqs.study.means import complete_seeds
from eqs.study.tables import composed, simulated, summarise_eqs, summarise_study

# Column, axis label, factor from the table's unit to the axis.
PANELS = (
    ("map_real", "mAP on real events\n(higher is better)", 100.0),
    ("retention", "retention: real / simulated mAP\n(higher is better)", 1.0),
    ("drop_rel", "relative drop: 1 - real / simulated, %\n(lower is better)", 100.0),
    ("drop_abs", "absolute drop: simulated - real, points\n(lower is better)", 100.0),
)
SCORE_LABEL = "EQS (higher is better)"
ANCHOR: dict[str, Any] = {"color": "#999999", "linewidth": 1.0, "zorder": 1}


def score_against_accuracy(
    study: pd.DataFrame, eqs: pd.DataFrame, results: Sequence[Correlation] = ()
) -> Figure:
    """Four panels: EQS against real mAP, retention, relative and absolute drop.

    Args:
        study: one row per (system, seed).
        eqs: one row per (system, sequence), for the chance and ceiling lines.
        results: correlations; only one that allows a conclusion is printed in its panel.
    """
    systems = summarise_study(study)
    tested = simulated(systems)
    anchors = summarise_eqs(simulated(eqs))[["eqs_chance", "eqs_ceiling"]].mean()
    by_target = {result.target.name: result for result in results if result.score == "eqs"}
    with mpl.rc_context(STYLE):
        drawing = figure(9, 7.2)
        for axes, (column, label, factor) in zip(drawing.subplots(2, 2).flat, PANELS, strict=True):
            _points(axes, tested, study, column, factor)
            _anchor_lines(axes, anchors)
            axes.set(xlabel=SCORE_LABEL, ylabel=label, title=_verdict(by_target.get(column)))
            axes.margins(x=0.12, y=0.18)
            if column == "map_real":
                _reference_line(axes, systems)
        # Names beside the marks would lie on each other where simulators are alike.
        marks, names = drawing.axes[0].get_legend_handles_labels()
        if names:
            drawing.legend(marks, names, loc="outside upper left", ncols=8)
    return drawing


def _points(
    axes: Axes, systems: pd.DataFrame, study: pd.DataFrame, column: str, factor: float
) -> None:
    spread = factor * complete_seeds(study).groupby("system")[column].std()
    colour = colours(systems["system"])
    for at, (_, row) in enumerate(systems.iterrows()):
        x, y = row["eqs"], factor * row[column]
        if not (np.isfinite(x) and np.isfinite(y)):
            continue
        error = spread[row["system"]]
        axes.errorbar(
            x,
            y,
            yerr=error if np.isfinite(error) else None,
            fmt=MARKERS[at % len(MARKERS)],
            color=colour[row["system"]],
            markersize=8,
            capsize=3,
            label=row["system"],
        )


def _anchor_lines(axes: Axes, anchors: pd.Series) -> None:
    for name, style in (("chance", ":"), ("ceiling", "-.")):
        value = anchors[f"eqs_{name}"]
        if np.isfinite(value):
            axes.axvline(value, linestyle=style, **ANCHOR)
            axes.annotate(
                name,
                (value, 0.02),
                xycoords=("data", "axes fraction"),
                xytext=(-3, 0),
                textcoords="offset points",
                rotation=90,
                ha="right",
                va="bottom",
                color="#666666",
            )


def _reference_line(axes: Axes, systems: pd.DataFrame) -> None:
    reference = systems[systems["simulator"] == REFERENCE]["map_real"].dropna()
    if len(reference):
        axes.axhline(100 * reference.iloc[0], color="#000000", linestyle="--", linewidth=1)
        axes.annotate(
            "trained on real events",
            (0.99, 100 * reference.iloc[0]),
            xycoords=("axes fraction", "data"),
            xytext=(0, 3),
            textcoords="offset points",
            ha="right",
        )


def _verdict(result: Correlation | None) -> str:
    if result is None:
        return ""
    if result.concludes and result.interval_pearson is not None:
        low, high = result.interval_pearson
        return (
            f"r = {result.pearson:.2f} [{low:.2f}, {high:.2f}], n = {result.n} systems in "
            f"{result.families} families"
        )
    if result.families < SIMULATORS_NEEDED:
        return f"{result.families} simulators: too few to conclude anything"
    return "One seed or no spread: no conclusion"


def accuracy_bars(study: pd.DataFrame) -> Figure:
    """Simulated and real mAP of every simulator and of the reference side by side, times 100."""
    systems = summarise_study(study[~composed(study)])
    sides = (
        ("map_sim", -0.2, 0.45, "tested on its simulated events"),
        ("map_real", 0.2, 1.0, "tested on real events"),
    )
    with mpl.rc_context({**STYLE, "axes.grid.axis": "y"}):
        drawing = figure(max(5.0, 1.6 * len(systems) + 1), 3.8)
        axes = drawing.subplots()
        for column, shift, alpha, _ in sides:
            _bars(axes, systems, column, shift, alpha)
        names = [
            "real events\n(no simulator)" if row["simulator"] == REFERENCE else row["system"]
            for _, row in systems.iterrows()
        ]
        axes.set_xticks(np.arange(len(systems)), names)
        axes.set(ylabel="mAP (higher is better)", xlabel="detector trained on")
        axes.margins(y=0.15)
        keys = [
            Line2D([], [], marker="s", markersize=9, linestyle="", color="#555555", alpha=alpha)
            for _, _, alpha, _ in sides
        ]
        drawing.legend(keys, [words for *_, words in sides], loc="outside upper left", ncols=2)
    return drawing


def _bars(axes: Axes, systems: pd.DataFrame, column: str, shift: float, alpha: float) -> None:
    colour = colours(systems["system"])
    place = np.arange(len(systems)) + shift
    heights = 100 * systems[column].to_numpy(dtype=float)
    if column == "map_sim":  # the reference has one test set, not two
        heights = np.where(systems["simulator"] == REFERENCE, np.nan, heights)
    bars = axes.bar(
        place, heights, 0.38, color=[colour[name] for name in systems["system"]], alpha=alpha
    )
    spread = 100 * systems[f"{column}_sd"].to_numpy(dtype=float)
    known = np.isfinite(spread) & np.isfinite(heights)
    axes.errorbar(
        place[known], heights[known], yerr=spread[known], fmt="none", ecolor="#333333", capsize=3
    )
    texts = [f"{height:.1f}" if np.isfinite(height) else "" for height in heights]
    axes.bar_label(bars, labels=texts, padding=4)


def sequence_dots(eqs: pd.DataFrame) -> Figure:
    """EQS of every sequence by system, the same sequence joined, with chance and ceiling."""
    table = simulated(eqs)
    wide = table.pivot(index="sequence", columns="system", values="eqs")
    names = list(dict.fromkeys(table["system"]))
    colour = colours(names)
    place = np.arange(len(names))[::-1]
    with mpl.rc_context({**STYLE, "axes.grid.axis": "x"}):
        drawing = figure(7.5, 1.4 + 0.6 * len(names))
        axes = drawing.subplots()
        means = summarise_eqs(table).set_index("system")
        _anchor_lines(axes, means[["eqs_chance", "eqs_ceiling"]].mean())
        for _, row in wide[names].iterrows():
            axes.plot(row, place, color="#bbbbbb", linewidth=0.7, zorder=2)
        for name, height in zip(names, place, strict=True):
            values = wide[name].to_numpy(dtype=float)
            axes.scatter(values, np.full(len(values), height), s=28, color=colour[name], zorder=3)
            mean = means.loc[name, "eqs"]
            if np.isfinite(mean):
                axes.plot(mean, height, "|", color="black", markersize=24, markeredgewidth=2)
                axes.annotate(
                    f"{mean:.3f}",
                    (mean, height),
                    xytext=(0, 13),
                    textcoords="offset points",
                    ha="center",
                )
        axes.set_yticks(place, names)
        axes.set_ylim(-0.6, len(names) - 0.4)
        axes.set_xlabel(SCORE_LABEL)
    return drawing
