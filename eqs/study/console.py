"""The study's tables on a terminal."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd
from rich.console import Console
from rich.table import Table as ConsoleTable

from eqs.study.layout import Table, number, scores_table
from eqs.study.notes import notes
from eqs.study.sanity import order_faults, readings, severity_correlations, untested
from eqs.study.tables import (
    MAP_COLUMNS,
    Drops,
    composed,
    score_columns,
    summarise_eqs,
    summarise_study,
)

CELL_FRAME = 3  # a border and a space on either side


def print_study(study: pd.DataFrame, console: Console) -> None:
    """Print mAP and drops of every system, means over seeds, times 100 as the paper does."""
    systems = summarise_study(study)
    several = ["seeds"] if systems["seeds"].gt(1).any() else []
    mixed = ["trained_on"] if composed(systems).any() else []
    names = ["system", *mixed, *several, *MAP_COLUMNS, *Drops._fields, "eqs"]
    print_table(_chosen(systems, names), "Detection accuracy (mAP, drops: x 100)", console)


def print_eqs(eqs: pd.DataFrame, console: Console, fewest_windows: int = 2) -> None:
    """Print the scores of every system: by sequence, then means with chance and ceiling.

    Below stands which sequences the means cover where these are not all, and which are short.
    """
    print_table(scores_table(eqs), "EQS by sequence (higher is better)", console)
    means = summarise_eqs(eqs)
    fewer = ["anchored"] if (means["anchored"] < means["sequences"]).any() else []
    names = ["system", "sequences", "eqs", *fewer, "eqs_chance", "eqs_ceiling", "eqs_scaled"]
    variants = [name for name in score_columns(means) if name != "eqs"]
    print_table(_chosen(means, names), "Event Quality Score (higher is better)", console)
    if variants:
        print_table(_chosen(means, ["system", *variants]), "EQS by activation", console)
    for note in notes(eqs, fewest_windows):
        console.print(f"[bold]note[/bold]: {note}")


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
    print_table(Table(header=("corruption", headline), rows=rows), "Sanity battery", console)
    for name in [headline, *(name for name in readings(table) if name != headline)]:
        faults, unknown = order_faults(table, name, expected), untested(table, name, expected)
        verdict = "as expected" if not faults else "not as expected, " + ", ".join(faults)
        verdict += f"; not tested: {', '.join(unknown)}" * bool(unknown)
        console.print(f"[bold]{name}[/bold]: order {verdict}")
        ranks = severity_correlations(table, name).items()
        console.print("  Spearman of severity: " + "; ".join(f"{k} {v:.2f}" for k, v in ranks))


def _chosen(frame: pd.DataFrame, names: list[str]) -> Table:
    rows = tuple(
        tuple(number(row[name], name) for name in names) for row in frame.to_dict("records")
    )
    return Table(header=tuple(names), rows=rows)


def print_table(table: Table, title: str, console: Console) -> None:
    """Print a table, in several that begin alike where the terminal is too narrow for one."""
    # A heading has a word a line; a name, which others may want to copy, stays whole.
    corner, *others = table.header
    headings = [corner, *(name.replace("_", "\n") for name in others)]
    columns = zip(*table.rows, strict=True) if table.rows else [()] * len(headings)
    widths = [
        max(map(len, [*heading.splitlines(), *cells]))
        for heading, cells in zip(headings, columns, strict=True)
    ]
    for places in _columns_that_fit(widths, console.width):
        drawn = ConsoleTable(title=title)
        for place in places:
            drawn.add_column(headings[place], justify="right" if place else "left", no_wrap=True)
        for row in table.rows:
            drawn.add_row(*(row[place] for place in places))
        console.print(drawn)


def _columns_that_fit(widths: Sequence[int], width: int) -> list[list[int]]:
    """Places of the columns of each table, the first column in all of them.

    Example:
        >>> _columns_that_fit([10, 30, 30, 30], width=80)
        [[0, 1, 2], [0, 3]]
    """
    tables = [[0]]
    for place in range(1, len(widths)):
        used = sum(widths[other] + CELL_FRAME for other in [*tables[-1], place]) + 1
        if used > width and len(tables[-1]) > 1:
            tables.append([0])
        tables[-1].append(place)
    return tables
