"""What has to be said beside means: which recordings they cover, and which of them are short."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from eqs.study.means import anchored_sequences, shared_sequences

NAMED = 8  # recordings in a sentence


def notes(eqs: pd.DataFrame, fewest: int = 2) -> tuple[str, ...]:
    """Sentences for whoever reads the means of these scores; none where nothing is unusual.

    Args:
        eqs: one row per (system, sequence).
        fewest: windows that have to count for a score to say much.
    """
    total = eqs.loc[eqs["eqs"].notna(), "sequence"].nunique()
    shared = shared_sequences(eqs)["sequence"].nunique()
    anchored = anchored_sequences(eqs)["sequence"].nunique()
    found = []
    if shared < total:
        found.append(
            f"Means cover {shared} of {total} sequences, those for which every system has a score."
        )
    if 0 < anchored < shared:
        found.append(
            f"Chance, ceiling and eqs_scaled cover {anchored} of {shared} sequences, those for "
            "which both are known, and eqs_scaled follows from the scores of these alone."
        )
    found.extend(marks(eqs))
    few = few_windows(scored_windows(eqs), fewest)
    return (*found, few) if few else tuple(found)


def marks(table: pd.DataFrame) -> list[str]:
    """What the mark of each marked system stands for; nothing where there is none."""
    if "caveat" not in table:
        return []
    caveats = table.groupby("system", sort=False)["caveat"].first().fillna("")
    return [
        f"{name}: {caveat}, so it is no point of a correlation."
        for name, caveat in caveats.items()
        if caveat
    ]


def scored_windows(eqs: pd.DataFrame) -> dict[str, int]:
    """The number of windows that count, by sequence."""
    known = eqs.dropna(subset=["n_windows"])
    fewest = known.groupby("sequence", sort=False)["n_windows"].min()
    return {str(name): int(count) for name, count in fewest.items()}


def few_windows(windows: Mapping[str, int], fewest: int) -> str:
    """A sentence that names the recordings of fewer windows; empty where there is none.

    Example:
        >>> few_windows({"a": 20, "b": 1}, fewest=20)[:44]
        'Few windows count in b (1): a score of fewer'
        >>> few_windows({"a": 20}, fewest=20)
        ''
    """
    named = [f"{name} ({count})" for name, count in windows.items() if count < fewest]
    if not named:
        return ""
    rest = [f"{len(named) - NAMED} others"] * (len(named) > NAMED)
    return (
        f"Few windows count in {', '.join([*named[:NAMED], *rest])}: a score of fewer than "
        f"{fewest} says little, with a warm-up cut short, and in a mean it weighs as much "
        "as any other."
    )
