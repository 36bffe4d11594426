"""The study's tables on a terminal."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd
from rich.console import Console
from rich.table import Table as ConsoleTable

from eqs.study.layout import Table, number, scores_table
from eqs.study.sanity import order_faults, readings, severity_correlations
from eqs.study.tables import MAP_COLUMNS, Drops, score_columns, summarise_eqs, summarise_study


def print_study(study: pd.DataFrame, console: Console) -> None:
    """Print mAP and drops of every system, means over seeds, times 100 as the paper does."""
    systems = summarise_study(study)
    names = ["system", "seeds", *MAP_COLUMNS, *Drops._fields, "eqs"]
    console.print(_drawn(_chosen(systems, names), "Detection accuracy (mAP, drops: x 100)"))


def print_eqs(eqs: pd.DataFrame, console: Console) -> None:
    """Print the scores of every system: by sequence, then means with chance and ceiling."""
    console.print(_drawn(scores_table(eqs), "EQS by sequence (higher is better)"))
    means = summarise_eqs(eqs)
    names = ["system", "sequences", "eqs", "eqs_chance", "eqs_ceiling", "eqs_scaled"]
    variants = [name for name in score_columns(means) if name != "eqs"]
    console.print(_drawn(_chosen(means, names), "Event Quality Score (higher is better)"))
    if variants:
        console.print(_drawn(_chosen(means, ["system", *variants]), "EQS by activation"))


def print_sanity(
    table: pd.DataFrame, headline: str, expected: Sequence[str], console: Console
) -> None:
    """Print what the headline makes of the damaged streams, and where each reading disagrees."""
    rows = tuple(
        (
            str(row["corruption"]) + ("" if pd.isna(row["severity"]) else f" {row['severity']:g}"),
            number(row[headline]),
        )
        for row in table.to_dict("records")
    )
    console.print(_drawn(Table(header=("corruption", headline), rows=rows), "Sanity battery"))
    for name in [headline, *(name for name in readings(table) if name != headline)]:
        faults = order_faults(table, name, expected)
        verdict = "as expected" if not faults else "not as expected, " + ", ".join(faults)
        console.print(f"[bold]{name}[/bold]: order {verdict}")
        ranks = severity_correlations(table, name).items()
        console.print("  Spearman of severity: " + "; ".join(f"{k} {v:.2f}" for k, v in ranks))


def _chosen(frame: pd.DataFrame, names: list[str]) -> Table:
    rows = tuple(
        tuple(number(row[name], name) for name in names) for row in frame.to_dict("records")
    )
    return Table(header=tuple(names), rows=rows)


def _drawn(table: Table, title: str) -> ConsoleTable:
    drawn = ConsoleTable(title=title)
    for place, name in enumerate(table.header):
        heading = name.replace("_", " ")  # a heading breaks at spaces, a name nowhere
        drawn.add_column(heading, justify="right" if place else "left", no_wrap=not place)
    for row in table.rows:
        drawn.add_row(*row)
    return drawn
