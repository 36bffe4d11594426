"""What a score makes of streams that were damaged in known ways: table, verdicts, figure."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from eqs.drawing.style import STYLE, figure
from eqs.study.means import complete_recordings
from eqs.study.statistics import spearman

NAMES = ("sequence", "sequences", "corruption", "severity")


def sanity_table(rows: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
    """Mean over recordings, one row per corruption and severity; a column for each reading.

    Convention: the recordings are those that have every corruption, `sequences` in number, so
    that what is compared is averaged over the same of them.

    Args:
        rows: each with `sequence`, `corruption`, `severity` (None for single corruptions) and
            the score under every reading.
    """
    frame = pd.DataFrame(list(rows))
    frame["severity"] = frame["severity"].astype(float)
    kind = ["corruption", "severity"]
    frame = complete_recordings(frame, kind)
    groups = frame.drop(columns="sequence").groupby(kind, sort=False, dropna=False)
    table = groups.mean().reset_index()
    table.insert(2, "sequences", frame["sequence"].nunique())
    return table


def readings(table: pd.DataFrame) -> list[str]:
    """The score columns of a sanity table."""
    return [name for name in table.columns if name not in NAMES]


def order_faults(table: pd.DataFrame, reading: str, expected: Sequence[str]) -> list[str]:
    """Neighbours of the expected order that a reading puts the wrong way round, as `a < b`.

    Example:
        >>> rows = [("identical", 1.0), ("chance", 0.2), ("blank", 0.3)]
        >>> table = pd.DataFrame(
        ...     [{"corruption": c, "severity": None, "x": v} for c, v in rows]
        ... )
        >>> order_faults(table, "x", ["identical", "chance", "blank"])
        ['chance < blank']
    """
    single = table[table["severity"].isna()].set_index("corruption")[reading]
    unknown = untested(table, reading, expected)
    pairs = itertools.pairwise(name for name in expected if name not in unknown)
    return [f"{a} < {b}" for a, b in pairs if single[a] < single[b]]


def untested(table: pd.DataFrame, reading: str, expected: Sequence[str]) -> list[str]:
    """The streams of the expected order that the table has no score of."""
    single = table[table["severity"].isna()].dropna(subset=[reading])["corruption"]
    return [name for name in expected if name not in set(single)]


def severity_correlations(table: pd.DataFrame, reading: str) -> dict[str, float]:
    """Spearman correlation of severity and score by graded corruption; -1 is best."""
    graded = table[table["severity"].notna()]
    found = {}
    for family, rows in graded.groupby("corruption", sort=False):
        value = spearman(rows["severity"].to_numpy(float), rows[reading].to_numpy(float))
        found[str(family)] = np.nan if value is None else value
    return found


def sanity_figure(table: pd.DataFrame, headline: str, expected: Sequence[str]) -> Figure:
    """Single corruptions as dots, those of the expected order first, and graded ones as curves."""
    single = table[table["severity"].isna()].set_index("corruption")
    ordered = [name for name in expected if name in single.index]
    ordered += [name for name in single.index if name not in ordered]
    graded = table[table["severity"].notna()]
    with mpl.rc_context(STYLE):
        drawing = figure(10, 5.2)
        left, right = drawing.subplots(1, 2, width_ratios=(1.2, 1))
        _dots(left, single.loc[ordered], headline, sum(name in expected for name in ordered))
        for family, rows in graded.groupby("corruption", sort=False):
            levels = np.arange(1, len(rows) + 1)
            span = f"{rows['severity'].iloc[0]:g} to {rows['severity'].iloc[-1]:g}"
            right.plot(levels, rows[headline], marker="o", label=f"{family}: {span}")
        right.set(xlabel="severity, five levels", ylabel="EQS (higher is better)", ylim=(None, 1))
        right.set_xticks(range(1, 6))
        right.legend(fontsize=8)
    return drawing


def _dots(axes: Axes, single: pd.DataFrame, headline: str, ranked: int) -> None:
    place = np.arange(len(single))[::-1]
    for name in readings(single.reset_index()):
        if name != headline:
            axes.plot(single[name], place, ".", color="#c8c8c8", zorder=1)
    axes.plot([], [], ".", color="#c8c8c8", label="other readings")
    axes.plot(single[headline], place, "o", color="#1f4e79", label=headline.replace("_", ", "))
    axes.axhline(place[ranked - 1] - 0.5, color="#777777", linewidth=0.8)
    axes.set_yticks(place, [str(name).replace("_", " ") for name in single.index])
    axes.set(xlabel="EQS (higher is better)", title="above the line: expected order, best first")
    axes.legend(loc="lower left", fontsize=8)
