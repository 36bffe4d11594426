"""The study's answer in a few plain sentences, each following from the numbers alone."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import pandas as pd

from eqs.names import REFERENCE
from eqs.study.correlation import SIMULATORS_NEEDED, Correlation
from eqs.study.tables import (
    RATIO_FLOOR,
    independent,
    simulated,
    summarise_eqs,
    summarise_study,
)


def answer(
    eqs: pd.DataFrame, study: pd.DataFrame | None = None, results: Sequence[Correlation] = ()
) -> tuple[str, ...]:
    """Who is closest, what is lost, and whether EQS saw it coming: one sentence each.

    Args:
        eqs: one row per (system, sequence).
        study: one row per (system, seed), or None where nothing was trained.
        results: the study's correlations; the one with real mAP words the last sentence.
    """
    sentences = [_closest(simulated(eqs))]
    if study is None or not len(simulated(study)):
        return (
            *sentences,
            "No detector was trained on these data, so nothing is known here about accuracy: "
            "this report compares event streams only.",
        )
    systems = summarise_study(study)
    sentences.append(_accuracy(systems))
    sentences.append(_foreseen(independent(simulated(systems)), results))
    return tuple(sentences)


def _closest(eqs: pd.DataFrame) -> str:
    means = summarise_eqs(eqs).dropna(subset=["eqs"]).sort_values("eqs", ascending=False)
    if eqs["eqs"].isna().all():
        return "No simulator has been scored yet."
    if means.empty:
        return "No sequence has been scored for every simulator, so EQS cannot compare them."
    best = means.iloc[0]
    words = f"By EQS, the closest simulator to the real stream is {best['system']} "
    words += f"(EQS {best['eqs']:.3f}, higher is better{_anchored(best)})"
    if best["sequences"] < eqs["sequence"].nunique():
        words += f", over the {best['sequences']} sequences that all of them have"
    if len(means) == 1:
        return f"{words}, the only one scored."
    others = (f"{row['system']} ({row['eqs']:.3f})" for _, row in means.iloc[1:].iterrows())
    wins, total = _lead(eqs, best["system"], means.iloc[1]["system"])
    return (
        f"{words}, before {', '.join(others)}; it is ahead of {means.iloc[1]['system']} in "
        f"{wins} of {total} sequences."
    )


def _anchored(row: pd.Series) -> str:
    if not np.isfinite(row["eqs_chance"]) or not np.isfinite(row["eqs_ceiling"]):
        return ""
    return f"; an unrelated scene gets {row['eqs_chance']:.3f} and the ceiling is " + (
        f"{row['eqs_ceiling']:.3f}" + _anchored_part(row)
    )


def _anchored_part(row: pd.Series) -> str:
    fewer = 0 < row["anchored"] < row["sequences"]
    return f", over {row['anchored']} of {row['sequences']} sequences" if fewer else ""


def _lead(eqs: pd.DataFrame, first: str, second: str) -> tuple[int, int]:
    """In how many of the shared sequences the first system scores above the second."""
    table = eqs.pivot(index="sequence", columns="system", values="eqs")[[first, second]].dropna()
    return int((table[first] > table[second]).sum()), len(table)


def _accuracy(systems: pd.DataFrame) -> str:
    trained = simulated(systems).dropna(subset=["map_real"])
    if trained.empty:
        return "No detector trained on simulated events has been tested on real ones yet."
    ranked = trained.sort_values("map_real", ascending=False)
    best, worst = ranked.iloc[0], ranked.iloc[-1]
    words = f"On real events, the best detector was trained on {best['system']}: {_lost(best)}"
    if len(ranked) > 1:
        words += f"; the worst, trained on {worst['system']}: {_lost(worst)}"
    reference = systems[systems["simulator"] == REFERENCE].dropna(subset=["map_real"])
    if len(reference):
        words += (
            "; a detector trained on real events reaches "
            f"{100 * reference.iloc[0]['map_real']:.1f} mAP on the same test set"
        )
    return f"{words}."


def _lost(row: pd.Series) -> str:
    real = f"{100 * row['map_real']:.1f} mAP"
    if not np.isfinite(row["drop_abs"]):
        return real
    if row["drop_abs"] < 0:
        return f"{real}, {-100 * row['drop_abs']:.1f} points more than on its simulated test set"
    words = f"{real}, {100 * row['drop_abs']:.1f} points less than on its simulated test set"
    if np.isfinite(row["drop_rel"]) and row["map_sim"] >= RATIO_FLOOR:
        words += f" ({100 * row['drop_rel']:.0f} % lost)"
    return words


def _foreseen(systems: pd.DataFrame, results: Sequence[Correlation]) -> str:
    known = systems.dropna(subset=["eqs", "map_real"])
    pairs = list(itertools.combinations(zip(known["eqs"], known["map_real"], strict=True), 2))
    if not pairs:
        return (
            "Whether EQS saw it coming cannot be asked yet: fewer than two simulators have both a "
            "score and an accuracy on real events."
        )
    agree = sum((a[0] - b[0]) * (a[1] - b[1]) > 0 for a, b in pairs)
    words = (
        f"Did EQS see it coming? It puts {agree} of {len(pairs)} pairs of simulators in the "
        "order of their real mAP"
    )
    main = next((r for r in results if r.score == "eqs" and r.target.name == "map_real"), None)
    if main is not None and main.concludes:
        return f"{words}. {main.sentence()}"
    few = known["simulator"].nunique() < SIMULATORS_NEEDED
    reason = (
        f"with {known['simulator'].nunique()} simulators, fewer than {SIMULATORS_NEEDED},"
        if few
        else "with one training seed or no spread"
    )
    return f"{words}, but {reason} nothing can be concluded from that."
