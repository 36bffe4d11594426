"""Which known damage of the real stream scores as a simulated one does."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from eqs.events import Events
from eqs.metrics import corruptions as damage

KEY: Final = "nearest"
FAR: Final = 0.01  # a score further from that of every damage is like none
NAMED: Final = 3

RATE_WEIGHT: Final = 0.1
FEWEST: Final = 1e-3


class Profile(NamedTuple):
    """What a stream is known by.

    Args:
        stages: its scores by stage, whose mean is its score.
        rate: its events per event of the real stream.
    """

    stages: tuple[float, ...]
    rate: float

    @property
    def score(self) -> float:
        """The score itself."""
        return float(np.mean(self.stages))

    def apart(self, other: Profile) -> float:
        """How unlike another it is, 0 for the same.

        Convention: the root of the mean square of the stages' differences and, a tenth as heavy,
        the logarithm of the ratio of the rates, put together as sides of a right angle.
        """
        differences = np.subtract(self.stages, other.stages)
        ratio = np.log((self.rate + FEWEST) / (other.rate + FEWEST))
        return float(np.hypot(np.sqrt(np.mean(differences**2)), RATE_WEIGHT * ratio))

    def towards(self, other: Profile, part: float) -> Profile:
        """What lies between, on straight lines."""
        stages = np.add(self.stages, part * np.subtract(other.stages, self.stages))
        return Profile(tuple(stages.tolist()), self.rate + part * (other.rate - self.rate))


class Family(NamedTuple):
    """One kind of damage, in grades that grow.

    Args:
        name: what it is called in files.
        words: how a grade is said to a person.
        grades: those that are tried; grade 0 is the real stream itself.
        make: the real stream with a grade of it.
        none: the grade that changes nothing.
    """

    name: str
    words: str
    grades: tuple[float, ...]
    make: Callable[[Events, float], Events]
    none: float = 0.0


class Nearest(NamedTuple):
    """The grade of a family that costs as much as a stream's score, or comes nearest.

    Args:
        family: its name.
        grade: how much of it.
        score: what that scores.
        words: the same for a person.
        apart: how unlike the stream it is, see `Profile.apart`.
    """

    family: str
    grade: float
    score: float
    words: str
    apart: float


def less_contrast(events: Events, divisor: float) -> Events:
    """What a sensor sends whose contrast thresholds are 2, 4, 8, ... times as high."""
    for _ in range(round(np.log2(divisor))):
        events = damage.at_double_threshold(events)
    return events


def every(events: Events, interval_ms: float) -> Events:
    """All events at the beats of a clock, as with a simulator that knows nothing between frames."""
    if not len(events):
        return events
    first, last = int(events.t[0]), int(events.t[-1])
    beats = np.arange(first, last + 1, round(1e3 * interval_ms))
    return damage.frame_locked(events, beats)


FAMILIES: Final = (
    Family("dropped", "{:.0%} of the events missing",
           (0.1, 0.3, 0.6, 0.9), partial(damage.thinned, key=KEY)),
    Family("noise", "{:.0%} noise events added",
           (0.02, 0.1, 0.5, 2.0), partial(damage.with_noise, key=KEY)),
    Family("jitter", "{:.2g} ms of jitter in time",
           (1.0, 3.0, 10.0, 30.0),
           lambda real, ms: damage.jittered_in_time(real, 1e3 * ms, key=KEY)),
    Family("shift", "{:.2g} pixels of jitter in space",
           (0.5, 1.0, 2.0, 4.0), partial(damage.jittered_in_space, key=KEY)),
    Family("contrast", "the contrast divided by {:.2g}", (2.0, 4.0, 8.0), less_contrast,
           none=1.0),
    Family("polarity", "{:.0%} of the polarities flipped",
           (0.1, 0.25, 0.5), partial(damage.some_flipped, key=KEY)),
    Family("strobe", "all events on the beat of one frame every {:.0f} ms",
           (5.0, 15.0, 30.0, 50.0), every),
    Family("hot", "{:.2%} hot pixels added",
           (5e-4, 2e-3, 5e-3), partial(damage.with_hot_pixels, key=KEY)),
)  # fmt: skip


def damaged(real: Events, family: Family) -> dict[float, Events]:
    """The real stream with every grade of a family, one family at a time to spare memory."""
    return {grade: family.make(real, grade) for grade in family.grades}


def nearest(own: Profile, tried: Mapping[str, Mapping[float, Profile]]) -> list[Nearest]:
    """By family the grade that scores as a stream does, the most alike first.

    Convention: between two grades, and between none and the first one, score and profile run
    straight; the lightest grade that scores so counts. Where none does, the grade with the nearest
    score stands for the family, behind those that do. A score alone cannot tell noise from jitter,
    so of several families that one comes first whose stages and number of events are most alike.

    Args:
        own: profile of the stream.
        tried: profiles of the damages by family and grade.

    Example:
        >>> half, most = Profile((0.9, 0.9), 0.7), Profile((0.7, 0.7), 0.4)
        >>> found = nearest(Profile((0.8, 0.8), 0.5), {"dropped": {0.3: half, 0.6: most}})
        >>> found[0].words
        '45% of the events missing'
    """
    found = [_of_family(family, own, tried[family.name]) for family in FAMILIES
             if family.name in tried]  # fmt: skip

    def order(each: Nearest) -> tuple[float, float]:
        away = abs(each.score - own.score)
        return (0.0 if away <= FAR else away, each.apart)

    return sorted(found, key=order)


def _of_family(family: Family, own: Profile, tried: Mapping[float, Profile]) -> Nearest:
    steps = [(family.none, Profile((1.0,) * len(own.stages), 1.0)), *sorted(tried.items())]
    grade, profile = min(steps[1:], key=lambda step: abs(step[1].score - own.score))
    for (lighter, before), (heavier, after) in itertools.pairwise(steps):
        if after.score <= own.score <= before.score:
            fall = before.score - after.score
            part = (before.score - own.score) / fall if fall else 0.0
            grade = lighter + part * (heavier - lighter)
            profile = before.towards(after, part)
            break
    words = family.words.format(grade)
    return Nearest(family.name, grade, profile.score, words, profile.apart(own))


def sentence(found: Sequence[Nearest], score: float, seconds: float) -> str:
    """What a stream is as far from real as, in its first seconds.

    Args:
        found: from `nearest`, which is not empty.
        score: of the stream, over these seconds.
        seconds: how many were tried.
    """
    stretch = f"in the first {seconds:.3g} s, where it scores {score:.3f}"
    best = found[0]
    if abs(best.score - score) > FAR:
        side = "further from real than" if score < best.score else "nearer to real than"
        return f"{side} every damage tried {stretch}: {best.words} scores {best.score:.3f}"
    others = [each.words for each in found[1:NAMED] if abs(each.score - score) <= FAR]
    besides = f"; as much would cost: {'; '.join(others)}" if others else ""
    return f"as far from real as: {best.words}, of those tried the most alike ({stretch}){besides}"
