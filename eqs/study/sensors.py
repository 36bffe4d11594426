"""Scores and accuracies on the events of several sensors, side by side."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import pandas as pd
from rich.console import Console

from eqs.study.console import print_table
from eqs.study.layout import Table, number
from eqs.study.tables import summarise_eqs, summarise_study
from eqs.study.written import read_table

SCORES = ("eqs", "eqs_chance", "eqs_ceiling", "sequences", "definition", "weights_sha256")
ACCURACIES = ("map_sim", "map_real", "seeds")
SHOWN = {
    "eqs": "Event Quality Score by sensor (higher is better)",
    "map_real": "mAP on the real events of each sensor (x 100)",
}


def sensors_table(folders: Mapping[str, Path]) -> pd.DataFrame:
    """One row per system and sensor: mean score, mean mAPs, and what measured them.

    Args:
        folders: by sensor the folder with its `eqs.csv` and `study.csv` or `accuracy.csv`; those
            that hold none of them are left out.
    """
    parts = []
    for sensor, folder in folders.items():
        means = [each for each in (_scores(folder), _accuracies(folder)) if each is not None]
        if means:
            joined = means[0] if len(means) == 1 else means[0].merge(means[1], "outer", "system")
            joined.insert(1, "sensor", sensor)
            parts.append(joined)
    table = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()
    return table.reindex(columns=["system", "sensor", *SCORES, *ACCURACIES])


def print_sensors(table: pd.DataFrame, console: Console) -> None:
    """Print the score and the mAP on real events, a row per system, a column per sensor."""
    for value, title in SHOWN.items():
        known = table.dropna(subset=[value])
        if known.empty:
            continue
        wide = known.pivot(index="system", columns="sensor", values=value)
        wide = wide.loc[known["system"].unique(), known["sensor"].unique()]
        rows = tuple(
            (str(system), *(number(cell, value) for cell in cells))
            for system, cells in zip(wide.index, wide.to_numpy().tolist(), strict=True)
        )
        print_table(Table(header=("system", *_short(wide.columns)), rows=rows), title, console)
    if len(table[["definition", "weights_sha256"]].dropna().drop_duplicates()) > 1:
        console.print(
            "[bold]note[/bold]: the sensors were scored by several judges or definitions; compare "
            "within a column, or set eqs.judge to one judge for all"
        )


def _short(labels: Iterable[str]) -> list[str]:
    """Names without their hashes, where they are still apart.

    Example:
        >>> _short(["gen4-e7a7e3bdc42b", "own-1", "own-2"])
        ['gen4', 'own-1', 'own-2']
    """
    names = {label: label.rpartition("-")[0] for label in labels}
    held = list(names.values())
    return [name if held.count(name) == 1 else label for label, name in names.items()]


def _scores(folder: Path) -> pd.DataFrame | None:
    path = folder / "eqs.csv"
    return summarise_eqs(read_table(path))[["system", *SCORES]] if path.is_file() else None


def _accuracies(folder: Path) -> pd.DataFrame | None:
    """Of the newer table, since either may be written without the other."""
    paths = [path for path in (folder / "study.csv", folder / "accuracy.csv") if path.is_file()]
    if not paths:
        return None
    newest = max(paths, key=lambda path: path.stat().st_mtime_ns)
    return summarise_study(read_table(newest))[["system", *ACCURACIES]]
