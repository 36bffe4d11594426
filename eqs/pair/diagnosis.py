"""What two streams are like, in numbers that need no judge and sentences that need no paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from eqs.events import Events
from eqs.metrics.baselines.rates import counts_per_pixel, rate_map_correlation
from eqs.metrics.baselines.timing import pixel_intervals
from eqs.pair import sentences

BEATS_HZ: Final = (8.0, 400.0)
BEAT_BIN_US: Final = 1_000
FEWEST_BINS: Final = 64
AROUND_BINS: Final = 25
CLEAR_BEAT: Final = 12.0  # times the median of the power around
HIGH_BEAT: Final = 0.1  # of the mean rate
HOT: Final = 10.0  # times the second busiest of the eight pixels around
HOT_HZ: Final = 10.0
QUIET_SHARE: Final = 0.25
NEIGHBOURS: Final = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], np.bool_)


class Finding(NamedTuple):
    """One line of a diagnosis.

    Args:
        name: what is compared.
        simulated: its value in the simulated stream; NaN where there is none.
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
    seconds, streams = 1e-6 * (stop_us - start_us), (simulated, real)
    maps = [counts_per_pixel(each) for each in streams]
    quiet, silent = quiet_pixels(maps[1]), maps[1] == 0
    rate = "events per pixel and second"
    rates = [float(each.mean()) / seconds for each in maps]
    shares = [float(each.p.mean()) if len(each) else np.nan for each in streams]
    waits = [_median(pixel_intervals(each)) / 1e3 for each in streams]
    beats = [frame_beat(each, start_us, stop_us) for each in streams]
    floors = [float(each[quiet].mean()) / seconds for each in maps]
    hot = [float(hot_pixels(each, real.height, seconds).mean()) for each in maps]
    filled = [float(np.mean(each > 0)) for each in maps]
    stray = [float(each[silent].sum() / max(each.sum(), 1)) for each in maps]
    alike = [rate_map_correlation(simulated, real), 1.0]
    rows = (
        ("event rate", rates, rate, sentences.of_rates),
        ("share of ON events", shares, "", sentences.of_shares),
        ("median time between events of a pixel", waits, "ms", sentences.of_waits),
        ("beat, as of frames or lamps", beats, "Hz", sentences.of_beats),
        ("rate of the quietest real pixels, a quarter or more", floors, rate, sentences.of_floors),
        ("share of hot pixels", hot, "", sentences.of_hot),
        ("share of pixels with any event", filled, "", sentences.of_filled),
        ("share of events where the real stream is silent", stray, "", sentences.of_stray),
        ("rank correlation of the pixels' rates with the real ones", alike, "",
         sentences.of_places),
    )  # fmt: skip
    findings = (
        Finding(name, values[0], values[1], unit, said(values[0], values[1]))
        for name, values, unit, said in rows
    )
    return Diagnosis(findings=tuple(findings), seconds=seconds)


def quiet_pixels(counts: NDArray[np.int64]) -> NDArray[np.bool_]:
    """The pixels with the fewest events, at least a quarter of them; all silent ones are in."""
    chosen: NDArray[np.bool_] = counts <= np.quantile(counts, QUIET_SHARE)
    return chosen


def hot_pixels(counts: NDArray[np.int64], height: int, seconds: float) -> NDArray[np.bool_]:
    """Pixels that fire by themselves: far more often than those around them.

    Convention: more than ten times the second busiest of the eight around, which counts as one
    event at least, and no less than ten times a second. What moves across a pixel also moves
    across two of its neighbours, and two hot pixels may touch.

    Args:
        counts: events by pixel, row by row.
        height: rows of the sensor.
        seconds: length of the stretch.
    """
    image = counts.reshape(height, -1)
    around = ndimage.rank_filter(image, -2, footprint=NEIGHBOURS, mode="nearest")
    hot = (image > HOT * np.maximum(around, 1)) & (image >= HOT_HZ * seconds)
    found: NDArray[np.bool_] = hot.ravel()
    return found


def frame_beat(events: Events, start_us: int, stop_us: int) -> float:
    """Frequency in Hz at which the number of events beats most clearly; 0 where none stands out.

    Convention: counts in bins of 1 ms, their spectrum from 8 to 400 Hz. A line stands out where its
    power is twelve times the median of those around, so that slow motion is no beat, and its wave
    is a tenth of the mean rate. Of a line and its harmonics the slowest counts that is half as high
    as the highest.
    """
    bins = (stop_us - start_us) // BEAT_BIN_US
    if bins < FEWEST_BINS or not len(events):
        return 0.0
    bin_of = (events.window(start_us, start_us + bins * BEAT_BIN_US).t - start_us) // BEAT_BIN_US
    counts, taper = np.bincount(bin_of, minlength=bins).astype(np.float64), np.hanning(bins)
    spectrum = np.abs(np.fft.rfft((counts - counts.mean()) * taper))
    at_hz = np.fft.rfftfreq(bins, 1e-6 * BEAT_BIN_US)
    inside = (at_hz >= BEATS_HZ[0]) & (at_hz <= BEATS_HZ[1])
    power, at_hz = spectrum[inside] ** 2, at_hz[inside]
    height = 2 * spectrum[inside] / max(counts.mean() * taper.sum(), 1e-9)
    around = ndimage.median_filter(power, size=AROUND_BINS, mode="nearest")
    clear = (power > CLEAR_BEAT * around) & (height >= HIGH_BEAT)
    if not clear.any():
        return 0.0
    first = int(np.argmax(clear & (height >= 0.5 * height[clear].max())))
    return float(at_hz[first + int(np.argmax(power[first : first + 3]))])


def _median(values: NDArray[np.int64]) -> float:
    return float(np.median(values)) if len(values) else float("nan")
