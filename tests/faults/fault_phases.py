"""The phases of a study, each as a command on the smallest data there are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from fault_harness import RECIPE, REPOSITORY, SMALL, Phase, places
from PIL import Image

EQS = ["-c", "from eqs.commands import main; raise SystemExit(main())"]


def clip(folder: Path) -> Path:
    """A folder of twelve pictures of a moving edge."""
    frames = folder / "frames"
    frames.mkdir(parents=True, exist_ok=True)
    for k in range(12):
        picture = np.full((96, 128), 60, np.uint8)
        picture[:, 8 * k : 8 * k + 40] = 200
        Image.fromarray(picture).save(frames / f"{k:04d}.png")
    return frames


def script(name: str, *more: str) -> list[str]:
    """The words of a script of the repository."""
    return [str(REPOSITORY / name), *more]


GENERATE = Phase(
    "generate",
    lambda folder: script("scripts/prepare.py", *SMALL, *places(folder)),
    ("datasets/**/*.png", "datasets/**/*.npy", "datasets/**/*.txt", "datasets/**/events.h5",
     "simulated/**/*.h5"),
)  # fmt: skip
SIMULATE = Phase(
    "simulate",
    lambda folder: script(
        "scripts/simulate.py", "sim=v2e", f"frames={clip(folder)}", "frames_per_second=30",
        f"out={folder / 'events.h5'}",
    ),
    ("events.h5",),
)  # fmt: skip
CONVERT = Phase(
    "convert",
    lambda folder: [*EQS, "convert", str(folder / "events.h5"), str(folder / "converted.h5")],
    ("converted.h5",),
    (SIMULATE,),
)
TRAIN = Phase(
    "train",
    lambda folder: script("train.py", "sim=esim", *SMALL, *RECIPE, *places(folder)),
    ("runs/**/last.ckpt",),
    (GENERATE,),
)
EVALUATE = Phase(
    "evaluate",
    lambda folder: script("evaluate.py", "--eqs", "eqs.judge=varied", *SMALL, *places(folder)),
    ("results/**/eqs.csv", "results/**/study.csv"),
    (GENERATE, TRAIN),
)
SCORE = Phase(
    "score",
    lambda folder: [
        *EQS, "score", str(folder / "events.h5"), str(folder / "events.h5"), "eqs.judge=varied",
        *places(folder),
    ],
    ("results/**/score.json", "**/eqs.csv"),
    (SIMULATE,),
)  # fmt: skip
PHASES = (GENERATE, SIMULATE, CONVERT, TRAIN, EVALUATE, SCORE)
