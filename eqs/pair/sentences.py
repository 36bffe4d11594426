"""What the numbers of a diagnosis mean, a plain sentence each: simulated first, then real."""

from __future__ import annotations

import math
from typing import Final

ALIKE: Final = 1.25  # ratios up to this are no difference worth a word
SHARES_ALIKE: Final = 0.05
HOT_ALIKE: Final = 1e-4
HARDLY_ANY: Final = 0.02
BEATS_ALIKE: Final = 0.05
SAME_PLACES, SOME_PLACES = 0.8, 0.4


def times(simulated: float, real: float, what: str) -> str:
    """How many times as much, in words.

    Example:
        >>> times(6.4, 2.0, "often"), times(1.0, 2.0, "often"), times(2.1, 2.0, "often")
        ('3.2 times as often', '0.50 times as often', 'about as often')
    """
    ratio = simulated / real
    if 1 / ALIKE <= ratio <= ALIKE:
        return f"about as {what}"
    return f"{ratio:.1f} times as {what}" if ratio > 1 else f"{ratio:.2f} times as {what}"


def of_rates(simulated: float, real: float) -> str:
    """Of events per pixel and second."""
    if not real:
        return "The real stream is silent." if simulated else "Both streams are silent."
    if not simulated:
        return "The simulated stream is silent."
    return f"It fires {times(simulated, real, 'often')} as the real sensor."


def of_shares(simulated: float, real: float) -> str:
    """Of the shares of ON events, NaN where there is no event."""
    if math.isnan(simulated) or math.isnan(real):
        return "One of the streams is silent."
    if abs(simulated - real) <= SHARES_ALIKE:
        return "Brighter and darker events are balanced alike."
    more, fewer = ("brighter", "darker") if simulated > real else ("darker", "brighter")
    return f"More of its events are {more} and fewer {fewer} than with the real sensor."


def of_waits(simulated: float, real: float) -> str:
    """Of the median time between events of a pixel, NaN where no pixel has two."""
    if math.isnan(simulated) or math.isnan(real):
        return "In one of the streams no pixel fires twice."
    if 1 / ALIKE <= max(simulated, 1e-3) / max(real, 1e-3) <= ALIKE:
        return "Events of a pixel follow each other at the same pace."
    if simulated < real:
        return "Events of a pixel follow each other faster: in bursts, or more of them."
    return "Events of a pixel follow each other more slowly."


def of_beats(simulated: float, real: float) -> str:
    """Of the frequencies at which the numbers of events beat, 0 where they do not."""
    if simulated and real:
        if abs(simulated - real) <= BEATS_ALIKE * real:
            return "Both keep the same beat."
        return (
            f"Its events come {simulated:.0f} times a second together, the real ones {real:.0f} "
            "times."
        )
    if simulated:
        return (
            f"Its events come {simulated:.0f} times a second together, as with frames or a "
            "multiple of their rate; the real ones do not."
        )
    if real:
        return f"The real events come {real:.0f} times a second together, as under lamps."
    return "Neither keeps a beat."


def of_floors(simulated: float, real: float) -> str:
    """Of the rates where the real sensor is quietest: its noise."""
    if not simulated and not real:
        return "Where the real sensor is quietest both are silent."
    if not simulated:
        return "It is silent where the real sensor is quietest: it lacks noise."
    if not real:
        return "It fires where the real sensor is silent: noise, or contrast that is not there."
    return f"Where the real sensor is quietest it fires {times(simulated, real, 'often')}."


def of_hot(simulated: float, real: float) -> str:
    """Of the shares of pixels that fire by themselves."""
    if simulated > 2 * real + HOT_ALIKE:
        return "More of its pixels fire by themselves."
    if real > 2 * simulated + HOT_ALIKE:
        return "It lacks the hot pixels of the real sensor."
    return "Hot pixels are about as frequent." if simulated or real else "Neither has hot pixels."


def of_filled(simulated: float, real: float) -> str:
    """Of the shares of pixels that fire at all."""
    if not real or not simulated:
        return "One of the streams is silent." if simulated or real else "Both are silent."
    return f"{times(simulated, real, 'many').capitalize()} pixels fire at all."


def of_stray(simulated: float, _: float) -> str:
    """Of the share of events on pixels that are silent in the real stream."""
    if simulated < HARDLY_ANY:
        return "Hardly any of its events fall where the real stream is silent."
    return f"{100 * simulated:.0f} % of its events fall where the real stream has none at all."


def of_places(simulated: float, _: float) -> str:
    """Of the rank correlation of the pixels' event numbers."""
    if simulated >= SAME_PLACES:
        return "The same pixels are busy."
    return "Partly the same pixels are busy." if simulated >= SOME_PLACES else "Others are busy."
