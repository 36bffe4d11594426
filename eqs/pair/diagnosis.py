"""What two streams are like, in numbers that need no judge and sentences that need no paper."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eqs.events import Events
from eqs.metrics.baselines.rates import counts_per_pixel
from eqs.metrics.baselines.timing import pixel_intervals

BEATS_HZ: Final = (8.0, 400.0)
BEAT_BIN_US: Final = 1_000
CLEAR_BEAT: Final = 12.0  # times the median of the spectrum
HOT: Final = 20.0  # times the mean rate of all pixels
QUIET_SHARE: Final = 0.25  # of the pixels of the real stream, those with the fewest events
ALIKE: Final = 1.25  # ratios up to this are no difference worth a word


class Finding(NamedTuple):
    """One line of a diagnosis.

    Args:
        name: what is compared.
        simulated: its value in the simulated stream.
        real: in the real one.
        unit: of both.
        sentence: what it means.
    """

    name: str
    simulated: float
    real: float
    unit: str
    sentence: str


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """All lines, and what they are about.

    Args:
        findings: the lines.
        seconds: length of the stretch.
    """

    findings: tuple[Finding, ...]
    seconds: float


def diagnose(simulated: Events, real: Events, *, start_us: int, stop_us: int) -> Diagnosis:
    """Compare two streams of one sensor over the same stretch of time.

    Args:
        simulated: events of that stretch.
        real: events of that stretch.
        start_us: its start.
        stop_us: its end.
    """
    seconds, pixels = 1e-6 * (stop_us - start_us), real.height * real.width
    maps = counts_per_pixel(simulated), counts_per_pixel(real)
    quiet = quiet_pixels(maps[1])

    def line(
        name: str, unit: str, values: tuple[float, float], say: Callable[[float, float], str]
    ) -> Finding:
        return Finding(name, *values, unit, say(*values))

    rates = tuple(float(each.sum()) / seconds / pixels for each in maps)
    shares = tuple(float(each.p.mean()) if len(each) else np.nan for each in (simulated, real))
    waits = tuple(_median(pixel_intervals(each)) / 1e3 for each in (simulated, real))
    beats = tuple(frame_beat(each, start_us, stop_us) for each in (simulated, real))
    floors = tuple(float(each[quiet].sum()) / seconds / max(quiet.sum(), 1) for each in maps)
    hot = tuple(float(np.mean(each > HOT * max(each.mean(), 1.0))) for each in maps)
    silent = maps[1] == 0
    stray = tuple(float(each[silent].sum() / max(each.sum(), 1)) for each in maps)
    filled = tuple(float(np.mean(each > 0)) for each in maps)
    return Diagnosis(
        findings=(
            line("event rate", "events per pixel and second", _two(rates), _rate_sentence),
            line("share of ON events", "", _two(shares), _share_sentence),
            line("median time between events of a pixel", "ms", _two(waits), _wait_sentence),
            line("strongest beat", "Hz", _two(beats), _beat_sentence),
            line("rate of the quietest quarter of the real pixels", "events per pixel and second",
                 _two(floors), _floor_sentence),
            line("share of hot pixels", "", _two(hot), _hot_sentence),
            line("share of pixels with any event", "", _two(filled), _filled_sentence),
            line("share of events on pixels silent in the real stream", "", _two(stray),
                 _stray_sentence),
        ),
        seconds=seconds,
    )  # fmt: skip


def quiet_pixels(counts: NDArray[np.int64]) -> NDArray[np.bool_]:
    """The pixels with the fewest events, at least a quarter of them."""
    chosen: NDArray[np.bool_] = counts <= np.quantile(counts, QUIET_SHARE)
    return chosen


def frame_beat(events: Events, start_us: int, stop_us: int) -> float:
    """Frequency in Hz at which the number of events beats most clearly; 0 where none stands out.

    Convention: counts in bins of 1 ms, their spectrum from 8 to 400 Hz; a line stands out where it
    is twelve times the median. Of a line and its harmonics the slowest that stands out counts.
    """
    bins = (stop_us - start_us) // BEAT_BIN_US
    if bins < 64 or not len(events):
        return 0.0
    edges = start_us + BEAT_BIN_US * np.arange(bins + 1)
    counts = np.histogram(events.t, edges)[0].astype(np.float64)
    power = np.abs(np.fft.rfft((counts - counts.mean()) * np.hanning(bins))) ** 2
    at_hz = np.fft.rfftfreq(bins, 1e-6 * BEAT_BIN_US)
    inside = (at_hz >= BEATS_HZ[0]) & (at_hz <= BEATS_HZ[1])
    power, at_hz = power[inside], at_hz[inside]
    strongest = power.max()
    if strongest <= CLEAR_BEAT * max(float(np.median(power)), 1e-9):
        return 0.0
    return float(at_hz[np.argmax(power >= 0.5 * strongest)])


def _median(values: NDArray[np.int64]) -> float:
    return float(np.median(values)) if len(values) else float("nan")


def _two(values: tuple[float, ...]) -> tuple[float, float]:
    return values[0], values[1]


def _times(simulated: float, real: float) -> str:
    """How many times as much, in words."""
    if not real:
        return "the same: none" if not simulated else "some, the real stream has none"
    ratio = simulated / real
    if not ratio:
        return "nothing"
    if 1 / ALIKE <= ratio <= ALIKE:
        return "about as much"
    return f"{ratio:.1f} times as much" if ratio > 1 else f"{1 / ratio:.1f} times less"


def _rate_sentence(simulated: float, real: float) -> str:
    return f"The simulated stream fires {_times(simulated, real)} as the real sensor.".replace(
        "less as", "less than"
    ).replace("nothing as", "nothing beside")


def _share_sentence(simulated: float, real: float) -> str:
    if not abs(simulated - real) > 0.05:
        return "Brighter and darker events are balanced alike."
    more, fewer = ("brighter", "darker") if simulated > real else ("darker", "brighter")
    return f"It has more {more} and fewer {fewer} events than the real sensor."


def _wait_sentence(simulated: float, real: float) -> str:
    if not simulated or not real or np.isnan(simulated) or np.isnan(real):
        return "One of them hardly has two events at a pixel."
    if 1 / ALIKE <= simulated / real <= ALIKE:
        return "Events of a pixel follow each other at the same pace."
    return (
        "Events of a pixel follow each other faster: bursts, or noise."
        if simulated < real
        else "Events of a pixel follow each other more slowly."
    )


def _beat_sentence(simulated: float, real: float) -> str:
    if simulated and not real:
        return f"Events come in time with something at {simulated:.0f} Hz, most likely the frames."
    if real and not simulated:
        return f"The real scene beats at {real:.0f} Hz, as lamps do; the simulated one does not."
    return "Both beat." if simulated else "Neither keeps a beat."


def _floor_sentence(simulated: float, real: float) -> str:
    return f"Where the real sensor is quietest there is {_times(simulated, real)}."


def _hot_sentence(simulated: float, real: float) -> str:
    if simulated > 2 * real + 1e-4:
        return "It has more pixels that fire without a reason."
    if real > 2 * simulated + 1e-4:
        return "It lacks the hot pixels of the real sensor."
    return "Hot pixels are as frequent."


def _filled_sentence(simulated: float, real: float) -> str:
    return f"Pixels with any event: {_times(simulated, real)}."


def _stray_sentence(simulated: float, _: float) -> str:
    if simulated < 0.02:
        return "Hardly any event falls where the real stream is silent."
    return f"{100 * simulated:.0f} % of its events fall where the real stream has none at all."
