"""Which known damage of the real stream scores as a simulated one does."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np

from eqs.events import Events
from eqs.metrics import corruptions as damage

STROBE_US: Final = 50_000
FAR: Final = 0.03  # a score further from every damage is like none

# By family: how a grade is said, and the grades.
DAMAGES: Final[Mapping[str, tuple[str, tuple[float, ...]]]] = {
    "dropped": ("{:.0%} of the events missing", (0.1, 0.3, 0.6, 0.9)),
    "noise": ("{:.0%} noise events added", (0.1, 0.5, 1.0, 2.0)),
    "jitter": ("every event up to {:.1f} ms early or late", (1.0, 3.0, 10.0, 30.0)),
    "shift": ("every event up to {:.1f} pixels astray", (0.5, 1.0, 2.0, 4.0)),
    "polarity": ("{:.0%} of the polarities flipped", (0.1, 0.25, 0.5, 1.0)),
    "contrast": ("a contrast threshold of {:.0f} times", (2.0,)),
    "strobe": ("all events at the instants of {:.0f} frames a second", (20.0,)),
}


class Nearest(NamedTuple):
    """A damage that costs about as much.

    Args:
        family: which.
        grade: how much of it.
        score: what that scores.
        words: said for a person.
    """

    family: str
    grade: float
    score: float
    words: str


def damaged(real: Events, *, start_us: int, stop_us: int) -> dict[tuple[str, float], Events]:
    """Every damage of `DAMAGES` by family and grade."""
    random: dict[str, Any] = {"key": "nearest"}
    frames = np.arange(start_us, stop_us + 1, STROBE_US)
    make: dict[str, Callable[[float], Events]] = {
        "dropped": partial(damage.thinned, real, **random),
        "noise": partial(damage.with_noise, real, **random),
        "jitter": lambda ms: damage.jittered_in_time(real, 1e3 * ms, **random),
        "shift": partial(damage.jittered_in_space, real, **random),
        "polarity": partial(damage.some_flipped, real, **random),
        "contrast": lambda _: damage.at_double_threshold(real),
        "strobe": lambda _: damage.frame_locked(real, frames),
    }
    return {
        (family, grade): make[family](grade)
        for family, (_, grades) in DAMAGES.items()
        for grade in grades
    }


def nearest(score: float, scores: Mapping[tuple[str, float], float]) -> list[Nearest]:
    """By family the grade that scores as a stream does, the closest first.

    Convention: between two grades, and between nothing and the first one, the score runs straight.
    Where a stream scores below the last grade, that is the family's answer, with its own score.

    Args:
        score: of the stream.
        scores: of the damages by family and grade.

    Example:
        >>> found = nearest(0.8, {("dropped", 0.3): 0.9, ("dropped", 0.6): 0.7})
        >>> found[0].words
        '45% of the events missing'
    """
    found = []
    for family in dict.fromkeys(family for family, _ in scores):
        grades = sorted(grade for other, grade in scores if other == family)
        values = [scores[family, grade] for grade in grades]
        if len(grades) == 1:
            grade, reached = grades[0], values[0]
        else:
            grade, reached = _between(score, [0.0, *grades], [1.0, *values])
        words = DAMAGES[family][0].format(grade)
        found.append(Nearest(family, grade, reached, words))
    return sorted(found, key=lambda each: abs(each.score - score))


def _between(score: float, grades: Sequence[float], values: Sequence[float]) -> tuple[float, float]:
    """The grade at which the score is first reached, and what is reached there."""
    for index in range(1, len(grades)):
        high, low = values[index - 1], values[index]
        if low <= score <= high:
            part = (high - score) / (high - low) if high > low else 0.0
            return grades[index - 1] + part * (grades[index] - grades[index - 1]), score
    closest = min(range(1, len(grades)), key=lambda k: abs(values[k] - score))
    return grades[closest], values[closest]


def sentence(found: Sequence[Nearest], score: float) -> str:
    """What a stream is as far from real as."""
    best = found[0]
    if abs(best.score - score) > FAR:
        return f"like no damage that was tried: the nearest, {best.words}, scores {best.score:.3f}"
    return f"as far from real as: {best.words}"
