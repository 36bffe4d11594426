"""Which rows a mean may cover: what stands side by side is averaged over the same of them."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

ANCHORED = ("eqs", "eqs_chance", "eqs_ceiling")
"""What a scaled score is made of: one that is missing leaves the recording out of all three."""


def shared_sequences(scores: pd.DataFrame) -> pd.DataFrame:
    """The rows of those sequences for which every system that was scored at all has a score.

    Example:
        >>> table = pd.DataFrame({"system": ["a", "a", "b"], "sequence": [1, 2, 2], "eqs": 0.5})
        >>> shared_sequences(table)["sequence"].tolist()
        [2, 2]
    """
    known = scores[scores["eqs"].notna()]
    systems = known.groupby("sequence")["system"].nunique()
    everywhere = systems.index[systems == known["system"].nunique()]
    return known[known["sequence"].isin(everywhere)]


def anchored_sequences(scores: pd.DataFrame) -> pd.DataFrame:
    """The rows of those shared sequences whose chance and ceiling are both known."""
    shared = shared_sequences(scores)
    unknown = shared.loc[shared[list(ANCHORED)].isna().any(axis=1), "sequence"]
    return shared[~shared["sequence"].isin(unknown)]


def whole_means(rows: pd.DataFrame, columns: Sequence[str]) -> pd.DataFrame:
    """Means by system; NaN for a column that lacks a value in any of a system's rows."""
    groups = rows.groupby("system", sort=False)
    chosen = groups[list(columns)]
    return chosen.mean().where(chosen.count().eq(groups.size(), axis=0))


def complete_recordings(frame: pd.DataFrame, kind: Sequence[str]) -> pd.DataFrame:
    """The rows of the recordings that have a row of every kind, `kind` naming the columns.

    Another scene exists only beside a recording of the same sensor size: a mean over the
    recordings that have it does not belong beside one over all of them.
    """
    kinds = len(frame[list(kind)].drop_duplicates())
    found = frame.groupby("sequence").size()
    return frame[frame["sequence"].isin(found.index[found == kinds])]


def complete_seeds(study: pd.DataFrame) -> pd.DataFrame:
    """The rows that have both mAPs, or all rows of a system that has no such row."""
    known = study[["map_sim", "map_real"]].notna().all(axis=1)
    return study[known | ~known.groupby(study["system"]).transform("any")]
