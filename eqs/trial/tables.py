"""What a trial found, as tables: pairs in order, ends, costs and orders that agree."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray
from rich.console import Console

from eqs.files import write_text
from eqs.trial.chains import CEILING
from eqs.trial.challengers import HEADLINE, RESET
from eqs.trial.order import floor_share, rank_agreement, shares_in_order, way_lost
from eqs.trial.recorded import BLANK, CHANCE, SIMULATOR
from eqs.trial.weights import learned, weighted

LEARNED: Final = "agreement, learned weights"
PRODUCTS: Final = {
    "agreement carried x reset": (HEADLINE, HEADLINE + RESET),
    "agreement x counts": (HEADLINE, "counts, 10 ms, 1 px: agreement"),
}
# Streams whose cost is required, by what they are called: kind, step and least cost.
COSTS: Final = {
    "strobe 20 Hz": ("strobe", 3, 0.30),
    "noise carpet 1:1": ("noise carpet", 3, 0.30),
    "threshold x2": ("contrast higher", 2, 0.15),
    "threshold x0.5": ("contrast lower", 2, 0.15),
    "polarity flipped": ("polarity flipped", 3, 0.25),
    "leak x10": ("more leak", 1, 0.10),
    "noise x3": ("more noise", 2, 0.10),
    "no noise": ("less noise", 2, 0.05),
}
DEVELOPMENT: Final = "development"


@dataclass(frozen=True, kw_only=True)
class Found:
    """Scores of all streams of a recording by one judge.

    Args:
        half: development, held_out or real.
        sensor: name of the camera.
        scene: name of the scene.
        judge: name of the judge.
        streams: kind and step of each stream.
        scores: by challenger, one per stream.
        channels: by stage the sums of `channel_sums`.
    """

    half: str
    sensor: str
    scene: str
    judge: str
    streams: tuple[tuple[str, int], ...]
    scores: Mapping[str, NDArray[np.float64]]
    channels: tuple[torch.Tensor, ...]

    @classmethod
    def load(cls, path: Path, **names: str) -> Found:
        """From the file of a recording."""
        with np.load(path) as data:
            arrays = {name: data[name] for name in data}
        streams = [str(each).rpartition("|") for each in arrays.pop("streams")]
        sums = [arrays.pop(name) for name in sorted(arrays) if name.startswith("channels_")]
        return cls(
            streams=tuple((kind, int(step)) for kind, _, step in streams),
            scores=arrays,
            channels=tuple(torch.from_numpy(each) for each in sums),
            **names,
        )

    def of(self, challenger: str) -> dict[tuple[str, int], float]:
        """A challenger's scores by kind and step."""
        return dict(zip(self.streams, self.scores[challenger].tolist(), strict=True))

    def chains(self) -> list[list[int]]:
        """Numbers of the streams of each chain, the ceiling first."""
        ceiling = self.streams.index((CEILING, 0))
        kinds = dict.fromkeys(k for k, _ in self.streams if k not in ENDS)
        return [
            [ceiling, *(i for i, (k, _) in enumerate(self.streams) if k == kind)] for kind in kinds
        ]


ENDS: Final = (CEILING, BLANK, CHANCE, SIMULATOR)


def with_composed(found: Sequence[Found]) -> list[Found]:
    """The same with products of scores, and with the channels weighted as was learned.

    Convention: weights are learned on the development half, for a recording of that half on those
    of other cameras.
    """
    weights = learned_weights(found)
    complete = []
    for each in found:
        scores = dict(each.scores)
        if (key := _lesson(each)) in weights:
            scores[LEARNED] = weighted(each.channels, weights[key]).numpy()
        for name, (one, other) in PRODUCTS.items():
            scores[name] = np.clip(scores[one], 0, None) * np.clip(scores[other], 0, None)
        complete.append(replace(each, scores=scores))
    return complete


def learned_weights(found: Sequence[Found]) -> dict[tuple[str, str], list[torch.Tensor]]:
    """Weights of channels by judge and by the camera that they were not learned on."""
    weights = {}
    for judge, left_out in {_lesson(each): None for each in found}:
        others = [
            each for each in found
            if each.half == DEVELOPMENT and each.judge == judge and each.sensor != left_out
        ]  # fmt: skip
        if others:
            weights[judge, left_out] = learned([(each.channels, each.chains()) for each in others])
    return weights


def _lesson(found: Found) -> tuple[str, str]:
    """The judge, and the camera that must not have taught; none outside the development half."""
    return found.judge, found.sensor if found.half == DEVELOPMENT else ""


def summary(found: Sequence[Found]) -> pd.DataFrame:
    """One row for each judge, half and challenger."""
    rows: list[dict[str, Any]] = []
    for judge in dict.fromkeys(each.judge for each in found):
        for half in dict.fromkeys(each.half for each in found):
            some = [each for each in found if each.judge == judge and each.half == half]
            rows += [
                {"judge": judge, "half": half, "challenger": name, **_row(some, name)}
                for name in (some[0].scores if some else ())
            ]
    return pd.DataFrame(rows)


def _row(found: Sequence[Found], name: str) -> dict[str, float]:
    orders, floors, ends, costs = [], [], [], []
    for each in found:
        scores = each.of(name)
        ceiling, blank, chance = (scores[end, 0] for end in (CEILING, BLANK, CHANCE))
        chain = {key: value for key, value in scores.items() if key[0] not in ENDS}
        same = [value for key, value in scores.items() if key[0] not in (BLANK, CHANCE)]
        orders.append(shares_in_order(ceiling, chain))
        floors.append(floor_share(same, chance, blank))
        ends.append((ceiling, chance, blank, float(blank <= chance + 0.02)))
        costs.append(
            {
                f"{shown} (>= {least:.2f})": way_lost(scores[kind, step], ceiling, chance)
                for shown, (kind, step, least) in COSTS.items()
                if (kind, step) in scores
            }
        )
    kinds = pd.DataFrame(orders).mean()
    middle = np.mean(ends, axis=0)
    return {
        "in_order": float(kinds.mean()),
        "above_floor": float(np.mean(floors)),
        "ceiling": middle[0],
        "chance": middle[1],
        "blank": middle[2],
        "blank_below_chance": middle[3],
        "rank_agreement": _agreement(found, name),
        **{f"cost: {shown}": value for shown, value in pd.DataFrame(costs).median().items()},
        **{f"order: {kind}": value for kind, value in kinds.items()},
    }


def _agreement(found: Sequence[Found], name: str) -> float:
    """Mean over cameras of how well the orders of simulators agree between its recordings."""
    means = []
    for sensor in dict.fromkeys(each.sensor for each in found):
        orders = [
            [value for (kind, _), value in each.of(name).items() if kind == SIMULATOR]
            for each in found
            if each.sensor == sensor
        ]
        means.append(rank_agreement(orders))
    known = [each for each in means if not np.isnan(each)]
    return float(np.mean(known)) if known else float("nan")


def simulator_table(found: Sequence[Found], simulators: Sequence[str], name: str) -> pd.DataFrame:
    """A challenger's score of every simulator on every recording."""
    rows = []
    for each in found:
        scores = each.of(name)
        rows.append(
            {
                "half": each.half,
                "sensor": Path(each.sensor).name,
                "scene": each.scene,
                "judge": each.judge,
                **{end: scores[end, 0] for end in (CEILING, CHANCE, BLANK)},
                **{s: scores[SIMULATOR, k] for k, s in enumerate(simulators)},
            }
        )
    return pd.DataFrame(rows)


def write_tables(
    found: Sequence[Found], simulators: Sequence[str], out: Path, console: Console
) -> None:
    """Write `trial.csv`, `simulators.csv` and `trial.md`, and print the main columns."""
    complete = with_composed(found)
    table = summary(complete)
    out.mkdir(parents=True, exist_ok=True)
    table.to_csv(out / "trial.csv", index=False, float_format="%.4f")
    simulator_table(complete, simulators, HEADLINE).to_csv(
        out / "simulators.csv", index=False, float_format="%.4f"
    )
    text = "\n\n".join(_sections(table))
    write_text(text + "\n", out / "trial.md")
    console.print(text, markup=False, highlight=False, soft_wrap=True)
    console.print(f"{out / 'trial.md'}, trial.csv, simulators.csv")


def _sections(table: pd.DataFrame) -> Iterable[str]:
    costs = [name for name in table if str(name).startswith("cost: ")]
    kinds = [name for name in table if str(name).startswith("order: ")]
    main = ["in_order", "above_floor", "blank_below_chance", "ceiling", "chance", "blank"]
    for (judge, half), rows in table.groupby(["judge", "half"], sort=False):
        yield f"## {half}, judge {judge}"
        yield markdown(rows, [*main, "rank_agreement"])
        yield markdown(rows, costs)
        yield markdown(rows, kinds)


def markdown(rows: pd.DataFrame, columns: Sequence[Any]) -> str:
    """A table of some columns, a line for each challenger."""
    shown = [str(name).rpartition(": ")[2].replace("_", " ") for name in columns]
    lines = ["| score | " + " | ".join(shown) + " |", "|---" * (len(shown) + 1) + "|"]
    for _, row in rows.iterrows():
        values = ["" if pd.isna(row[name]) else f"{row[name]:.3f}" for name in columns]
        lines.append(f"| {row['challenger']} | " + " | ".join(values) + " |")
    return "\n".join(lines)
