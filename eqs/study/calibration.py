"""What a calibration changed: parameters, and every measure before and after."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pandas as pd
from rich.console import Console
from rich.table import Table


def calibration_table(measured: Mapping[str, Sequence[Mapping[str, float]]]) -> pd.DataFrame:
    """Means over recordings, a row for each measure and a column for before and after.

    A measure that one of the recordings lacks has no mean.
    """
    frames = {name: pd.DataFrame(list(rows)) for name, rows in measured.items()}
    return pd.DataFrame({name: frame.mean(skipna=False) for name, frame in frames.items()})


def print_calibration(
    table: pd.DataFrame,
    before: Mapping[str, float],
    after: Mapping[str, float],
    console: Console,
) -> None:
    """Print the parameters and the measures on recordings that were not tuned on."""
    drawn = Table("", *map(str, table.columns), title="On recordings that were not tuned on")
    for name, value in before.items():
        drawn.add_row(name, f"{value:.4g}", f"{after[name]:.4g}")
    drawn.add_section()
    for measure, row in table.iterrows():
        drawn.add_row(str(measure), *(f"{value:.3f}" for value in row))
    console.print(drawn)
