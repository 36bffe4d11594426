"""The study's two tables: what their columns mean, how they are completed, written and read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from eqs.names import BASELINE, REFERENCE
from eqs.study.means import (
    ANCHORED,
    anchored_sequences,
    complete_seeds,
    shared_sequences,
    whole_means,
)

RATIO_FLOOR = 0.10
"""Below this simulated mAP a ratio to it rests on too little to be read."""

MAP_COLUMNS = ("map_sim", "map50_sim", "map_real", "map50_real")
STUDY_COLUMNS = (
    "simulator",
    "system",
    "trained_on",
    "seed",
    *MAP_COLUMNS,
    "drop_abs",
    "drop_rel",
    "retention",
    "eqs",
    "eqs_distance",
    "definition",
    "weights_sha256",
    "protocol",
)
EQS_COLUMNS = (
    "simulator",
    "system",
    "sequence",
    "eqs",
    "eqs_distance",
    "eqs_chance",
    "eqs_ceiling",
    "eqs_scaled",
    "start_us",
    "stop_us",
    "n_windows",
    "n_events_real",
    "n_events_sim",
    "definition",
    "weights_sha256",
)
TEXT_COLUMNS = frozenset(
    {"simulator", "system", "sequence", "split", "corruption", "anchor"}
    | {"definition", "weights_sha256", "protocol", "recipe", "data"}
    | {"trained_on", "beside", "before", "caveat"}
)
COUNT_COLUMNS = ("n_windows", "n_events_real", "n_events_sim")
TIME_COLUMNS = ("start_us", "stop_us")


class Drops(NamedTuple):
    """What a detector loses on its way from simulated to real events.

    Convention: "drop" alone is ambiguous, and the readings can disagree in sign when related to
    a score, so all of them stand side by side.
    """

    drop_abs: float
    """sim - real"""
    drop_rel: float
    """1 - real / sim"""
    retention: float
    """real / sim"""


def drops(map_sim: float, map_real: float) -> Drops:
    """The absolute drop, the relative drop and the retention of one trained detector.

    Args:
        map_sim: mAP on the detector's own simulated test set, in [0, 1].
        map_real: mAP on the real test set, in [0, 1].

    Returns:
        Ratios are NaN where `map_sim` is 0 and everything is NaN where an mAP is missing.

    Example:
        >>> [round(value, 3) for value in drops(0.344, 0.186)]
        [0.158, 0.459, 0.541]
    """
    retention = map_real / map_sim if map_sim else np.nan
    return Drops(map_sim - map_real, 1 - retention, retention)


def scaled_score(
    score: float | pd.Series, chance: float | pd.Series, ceiling: float | pd.Series
) -> float | pd.Series:
    """Where a score lies between chance (0) and ceiling (1); NaN where the two coincide.

    Example:
        >>> scaled_score(0.5, chance=0.25, ceiling=0.75)
        0.5
    """
    span = ceiling - chance
    if isinstance(span, pd.Series):
        return (score - chance) / span.where(span != 0)
    return (score - chance) / span if span else np.nan


def score_columns(table: pd.DataFrame) -> list[str]:
    """The headline `eqs` and every variant column, `eqs_<tap>_<features>`, of a table."""
    variants = (name for name in table.columns if name.startswith("eqs_"))
    return [
        "eqs",
        *(
            name
            for name in variants
            if name.endswith(("_raw", "_silence", "_centred", "_whitened"))
        ),
    ]


def baseline_columns(table: pd.DataFrame) -> list[str]:
    """The columns of EQS's rivals in a table."""
    return [name for name in table.columns if name.startswith(BASELINE)]


def study_table(
    rows: Iterable[Mapping[str, Any]] | pd.DataFrame, scores: pd.DataFrame | None = None
) -> pd.DataFrame:
    """Complete and check the rows of `study.csv`, one per (system, seed).

    Args:
        rows: each with `simulator`, `seed` and the four mAPs in [0, 1]; `system` names one
            simulator with one setting and defaults to `simulator`, as does `trained_on`, all the
            events that the detector saw, in words. Columns `ap_<set>_<class>` hold AP per class. A
            negative AP, COCO's mark for "no such box", becomes empty.
        scores: an EQS table; its means over sequences are joined by system.

    Raises:
        ValueError: a column is missing, an mAP lies above 1, a (system, seed) occurs twice, or a
            value is an absolute path.
    """
    table = _frame(rows, required=("simulator", "seed", *MAP_COLUMNS), name="study")
    precision = [*MAP_COLUMNS, *(str(name) for name in table if str(name).startswith("ap_"))]
    table[precision] = table[precision].astype(float)
    table[precision] = table[precision].where(table[precision] >= 0)
    _refuse_percentages(table, precision)
    table[list(Drops._fields)] = _lost(table)
    if "trained_on" not in table:
        table["trained_on"] = table["simulator"]
    if scores is not None:
        means = summarise_eqs(scores)
        joined = [*score_columns(means), *baseline_columns(means), "definition", "weights_sha256"]
        means = means[["system", *joined]]
        table = table.drop(columns=joined, errors="ignore").merge(means, how="left", on="system")
    table = _complete(table, STUDY_COLUMNS)
    table["eqs_distance"] = 1 - table["eqs"].astype(float)
    last = table["simulator"] == REFERENCE  # what simulators are measured by, not one of them
    table = pd.concat([table[~last], table[last]])
    return _checked(table, key=("system", "seed"))


def eqs_table(rows: Iterable[Mapping[str, Any]] | pd.DataFrame) -> pd.DataFrame:
    """Complete and check the rows of `eqs.csv`, one per (system, sequence).

    Args:
        rows: each with `simulator`, `sequence` and `eqs`; chance and ceiling where known.

    Raises:
        ValueError: a column is missing, a (system, sequence) occurs twice, a value is an
            absolute path, or the rows stem from several definitions or judges.
    """
    table = _frame(rows, required=("simulator", "sequence", "eqs"), name="EQS")
    table = _complete(table, EQS_COLUMNS)
    numbers = [name for name in EQS_COLUMNS if name not in TEXT_COLUMNS]
    table[numbers] = table[numbers].astype(float)
    table["eqs_distance"] = 1 - table["eqs"]
    table["eqs_scaled"] = scaled_score(table["eqs"], table["eqs_chance"], table["eqs_ceiling"])
    for name in (*TIME_COLUMNS, *COUNT_COLUMNS):
        table[name] = table[name].astype("Int64")
    for name in ("definition", "weights_sha256"):
        found = sorted(table[name].dropna().unique())
        if len(found) > 1:
            raise ValueError(
                f"Expected scores of one {name}, got {', '.join(found)}; scores of different "
                "ones cannot be compared, so write one table for each"
            )
    return _checked(table, key=("system", "sequence"))


def summarise_study(study: pd.DataFrame) -> pd.DataFrame:
    """One row per system: means over seeds, `seeds`, and `_sd` columns of the two mAPs.

    Convention: a seed counts that has both mAPs, where a system has one. Drops and retention
    follow from the mean mAPs, so a row agrees with itself; `_sd` is the sample standard deviation,
    NaN with one seed.
    """
    study = complete_seeds(study)
    numbers = [name for name in study.select_dtypes("number") if name not in ("seed", "seeds")]
    groups = study.groupby("system", sort=False)
    means = groups[numbers].mean()
    for name in ("map_sim", "map_real"):
        means[f"{name}_sd"] = groups[name].std()
    means[list(Drops._fields)] = _lost(means)
    means.insert(0, "simulator", groups["simulator"].first())
    means.insert(1, "seeds", groups["seed"].nunique())
    for name in ("trained_on", "caveat"):
        if name in study:
            means.insert(1, name, groups[name].first())
    return means.reset_index()


def summarise_eqs(scores: pd.DataFrame) -> pd.DataFrame:
    """One row per system: unweighted means over sequences, `sequences`, `eqs_sd`, summed counts.

    Convention: means cover the sequences for which every system has a score; a column that lacks
    a value there has no mean. Chance, ceiling and `eqs_scaled` cover those among them whose chance
    and ceiling are both known, `anchored` in number, and so does the score that `eqs_scaled`
    follows from.
    """
    systems, rows = scores.groupby("system", sort=False), shared_sequences(scores)
    groups, averaged = rows.groupby("system", sort=False), [*score_columns(scores)]
    averaged += [*baseline_columns(scores), "eqs_distance", "eqs_chance", "eqs_ceiling"]
    means = whole_means(rows, averaged).reindex(systems.size().index)
    anchored = anchored_sequences(scores).groupby("system", sort=False)
    known = anchored[list(ANCHORED)].mean()
    means.update(known.drop(columns="eqs"))
    means["eqs_scaled"] = scaled_score(known["eqs"], known["eqs_chance"], known["eqs_ceiling"])
    means["eqs_sd"] = groups["eqs"].std()
    means.insert(0, "simulator", systems["simulator"].first())
    means.insert(1, "sequences", groups["sequence"].nunique())
    means.insert(2, "anchored", anchored["sequence"].nunique())
    counted = ["sequences", "anchored"]
    means[counted] = means[counted].fillna(0).astype(int)
    for name in COUNT_COLUMNS:
        means[name] = groups[name].sum(min_count=1)
    for name in ("definition", "weights_sha256", *(["caveat"] if "caveat" in scores else [])):
        means[name] = systems[name].first()
    return means.reset_index()


def simulated(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of simulators: the real reference is an upper bound, not a system under test.

    Neither is a detector that saw several streams, or a part of one: no stream of it has a score.
    """
    return table[(table["simulator"] != REFERENCE) & ~composed(table)]


def independent(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of simulators that are ones like others, without the caveat of a marked row."""
    if "caveat" not in table:
        return table
    return table[table["caveat"].fillna("") == ""]


def composed(table: pd.DataFrame) -> pd.Series:
    """Which rows are of detectors that saw anything but one stream whole."""
    if "trained_on" not in table:  # a table of scores
        return pd.Series(False, index=table.index)
    return table["trained_on"] != table["simulator"]


def _lost(table: pd.DataFrame) -> NDArray[np.float64]:
    pairs = zip(table["map_sim"], table["map_real"], strict=True)
    return np.array([drops(*pair) for pair in pairs], dtype=float).reshape(-1, 3)


def _frame(
    rows: Iterable[Mapping[str, Any]] | pd.DataFrame, required: tuple[str, ...], name: str
) -> pd.DataFrame:
    table = rows.copy() if isinstance(rows, pd.DataFrame) else pd.DataFrame(list(rows))
    if table.empty and not len(table.columns):
        table = pd.DataFrame(columns=list(required))
    missing = [column for column in required if column not in table]
    if missing:
        raise ValueError(
            f"Expected every row of the {name} table to have {', '.join(required)}, "
            f"got none for {', '.join(missing)}; add them to each row"
        )
    if "system" not in table:
        table["system"] = table["simulator"]
    return table


def _complete(table: pd.DataFrame, columns: tuple[str, ...]) -> pd.DataFrame:
    for name in columns:
        if name not in table:
            table[name] = pd.Series(
                np.nan, index=table.index, dtype=object if name in TEXT_COLUMNS else float
            )
    others = [name for name in table.columns if name not in columns]
    return table[[*columns, *others]]


def _refuse_percentages(table: pd.DataFrame, columns: list[str]) -> None:
    for name in columns:
        largest = table[name].max()
        if largest > 1:
            raise ValueError(
                f"Expected {name} as a fraction in [0, 1], got {largest:g}; divide by 100"
            )


def _checked(table: pd.DataFrame, key: tuple[str, str]) -> pd.DataFrame:
    twice = table[table.duplicated(list(key))]
    if len(twice):
        first = ", ".join(f"{name} {twice.iloc[0][name]}" for name in key)
        raise ValueError(
            f"Expected one row per {' and '.join(key)}, got {first} more than once; "
            "give each setting of a simulator its own system label"
        )
    for name in table.columns:
        for value in table[name]:
            if isinstance(value, str) and (Path(value).is_absolute() or "\\" in value):
                raise ValueError(
                    f"Expected tables free of machine paths, got {value!r} in column {name}; "
                    "store a name or a hash instead"
                )
    return table.reset_index(drop=True)
