"""Tables as a reader sees them: chosen columns, units of the paper, two or three digits."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from eqs.names import BASELINE, REFERENCE
from eqs.study.means import shared_sequences
from eqs.study.printed import printed_accuracy, printed_scores
from eqs.study.tables import (
    MAP_COLUMNS,
    RATIO_FLOOR,
    baseline_columns,
    composed,
    score_columns,
    simulated,
    summarise_eqs,
)

MISSING = "n/a"
PERCENT_COLUMNS = frozenset({*MAP_COLUMNS, "drop_abs", "drop_rel", "map_sim_sd", "map_real_sd"})
HASH_DIGITS = 12


@dataclass(frozen=True, kw_only=True)
class Table:
    """Ready text, row by row; `strong` marks (row, column) of the best values.

    Args:
        header: one name per column.
        rows: cells as text.
        strong: positions to emphasise.
    """

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    strong: frozenset[tuple[int, int]] = frozenset()


def number(value: object, name: str = "") -> str:
    """A value as the paper prints it: mAP and drops times 100, scores with three digits.

    Example:
        >>> number(0.186, "map_real"), number(0.8284, "eqs"), number(float("nan"))
        ('18.6', '0.828', 'n/a')
    """
    if value is None or value is pd.NA or value is pd.NaT or value != value:
        return MISSING
    if isinstance(value, str):
        is_hash = name == "definition" or name.endswith(("sha256", "hash"))
        return value[:HASH_DIGITS] if is_hash else value
    if name in PERCENT_COLUMNS or name.startswith("ap_"):
        return f"{100 * float(value):.1f}"  # type: ignore[arg-type]
    if isinstance(value, float):
        return f"{value:.3f}"
    return f"{value:,}".replace(",", " ") if isinstance(value, int) else str(value)


def scores_table(eqs: pd.DataFrame) -> Table:
    """EQS by sequence and simulator with the average below, as in the paper's table.

    Convention: where a simulator lacks a sequence, the average covers the sequences of all.
    """
    shared = shared_sequences(simulated(eqs))["sequence"].unique()
    wide = simulated(eqs).pivot(index="sequence", columns="system", values="eqs")
    wide = wide[list(dict.fromkeys(simulated(eqs)["system"]))].sort_index()
    complete = wide.loc[wide.index.isin(shared)]
    if len(complete):
        name = "average" if len(complete) == len(wide) else "average of complete rows"
        wide.loc[name] = complete.mean()
    return _best_per_row(wide, "Sequence")


def printed_scores_table() -> Table:
    """The paper's EQS table."""
    return _best_per_row(printed_scores(), "DSEC sequence")


def accuracy_table(systems: pd.DataFrame) -> Table:
    """Simulated and real mAP with all drops, the printed mAPs of the same simulator beside."""
    printed = printed_accuracy()
    rows = []
    for (_, row), mixed in zip(systems.iterrows(), composed(systems), strict=True):
        known = row["simulator"] in printed.index and row["simulator"] == row["system"]
        theirs = printed.loc[row["simulator"]] if known else {}
        rows.append(
            (
                str(row["trained_on" if mixed else "system"])
                + (" (no simulator)" if row["simulator"] == REFERENCE else "")
                + (f", seeds: {row['seeds']}" if systems["seeds"].nunique() > 1 else ""),
                _with_spread(row, "map_sim"),
                _with_spread(row, "map_real"),
                number(row["drop_abs"], "drop_abs"),
                *(_ratio(row, name) for name in ("drop_rel", "retention")),
                number(row["eqs"]),
                *(number(theirs.get(name), name) for name in ("map_sim", "map_real")),
                *(number(theirs.get(name), name) for name in ("drop_abs", "drop_rel")),
            )
        )
    header = (
        "Trained on",
        "mAP simulated",
        "mAP real",
        "absolute drop, points",
        "relative drop, %",
        "retention",
        "EQS",
        "printed: mAP simulated",
        "printed: mAP real",
        "from printed: absolute drop",
        "from printed: relative drop, %",
    )
    return Table(header=header, rows=tuple(rows))


def summary_table(eqs: pd.DataFrame) -> Table:
    """Every score column per simulator, averaged over sequences, with chance and ceiling."""
    means = summarise_eqs(eqs)
    names = [*score_columns(means), "eqs_chance", "eqs_ceiling", "eqs_scaled", "sequences"]
    names += ["anchored"] * bool((means["anchored"] < means["sequences"]).any())
    names += ["n_events_sim", "n_events_real"]
    return frame_table(means[["system", *names]])


def baselines_table(eqs: pd.DataFrame, study: pd.DataFrame | None = None) -> Table:
    """EQS and every rival per simulator, one row per score.

    Averaged over sequences, or over seeds where only the study knows the score: over those for
    which it is known of every system.
    """
    means = summarise_eqs(eqs).set_index("system")
    if study is not None:
        trained = study[study["system"].isin(means.index)]
        others = [name for name in baseline_columns(study) if name not in means]
        for name in others:
            wide = trained.pivot(index="seed", columns="system", values=name)
            means[name] = wide.dropna(axis="columns", how="all").dropna().mean()
    names = ["eqs", *baseline_columns(means)]
    rows = [
        (
            name.removeprefix(BASELINE),
            *(number(float(value)) for value in means[name]),
            better(name),
        )
        for name in names
    ]
    return Table(header=("score", *map(str, means.index), "better"), rows=tuple(rows))


def better(column: str) -> str:
    """Which end of a score is the good one, told by its name."""
    return "lower" if column.endswith(("_error", "_distance")) else "higher"


def frame_table(frame: pd.DataFrame) -> Table:
    """A whole table, columns without a single value left out."""
    kept = frame.dropna(axis="columns", how="all")
    names = [str(name) for name in kept.columns]
    columns = [[number(value, name) for value in kept[name].tolist()] for name in names]
    return Table(header=tuple(names), rows=tuple(zip(*columns, strict=True)))


def _best_per_row(wide: pd.DataFrame, corner: str) -> Table:
    rows, strong = [], set()
    for place, (name, row) in enumerate(wide.iterrows()):
        rows.append((str(name), *(number(float(value)) for value in row)))
        strong |= {(place, 1 + at) for at, value in enumerate(row) if value == row.max()}
    header = (corner, *map(str, wide.columns))
    return Table(header=header, rows=tuple(rows), strong=frozenset(strong))


def _ratio(row: pd.Series, name: str) -> str:
    return number(row[name], name) + " *" * bool(row["map_sim"] < RATIO_FLOOR)


def _with_spread(row: pd.Series, name: str) -> str:
    spread = number(row[f"{name}_sd"], name)
    return number(row[name], name) + (f" ± {spread}" if spread != MISSING else "")
