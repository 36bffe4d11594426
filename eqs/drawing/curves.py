"""Curves over time: event rates, the score of each window, the accuracy of a training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from eqs.drawing.style import MARKERS, STYLE, colours, figure
from eqs.events import Events
from eqs.names import REFERENCE


def event_rate(events: Events, start_us: int, stop_us: int, bin_us: int) -> NDArray[np.float64]:
    """Events per pixel and second in consecutive bins; a last bin cut short is left out.

    Raises:
        ValueError: the window holds no whole bin.
    """
    bins = (stop_us - start_us) // bin_us
    if bins < 1:
        raise ValueError(
            f"Expected a window of at least one bin of {bin_us} us, got {stop_us - start_us} us; "
            "set a longer window or a shorter bin"
        )
    inside = events.window(start_us, start_us + bins * bin_us)
    counts = np.bincount((inside.t - start_us) // bin_us, minlength=bins)
    return counts * 1e6 / (bin_us * events.height * events.width)


def rate_curves(
    rates: Mapping[str, ArrayLike], *, bin_us: int, frame_times_us: ArrayLike = ()
) -> Figure:
    """Event rates over time of every stream.

    Args:
        rates: by stream, as `event_rate` gives them, from one common start.
        bin_us: length of a bin.
        frame_times_us: times of video frames since that start, drawn as ticks.
    """
    colour = colours(rates)
    with mpl.rc_context(STYLE):
        drawing = figure(9, 3.8)
        axes = drawing.subplots()
        for name, values in sorted(rates.items(), key=lambda item: item[0] == REFERENCE):
            heights = np.asarray(values, dtype=float)
            real = name == REFERENCE
            axes.stairs(
                heights,
                np.arange(len(heights) + 1) * bin_us / 1e6,
                color=colour[name],
                linewidth=1.8 if real else 1.1,
                label="real sensor" if real else name,
                baseline=None,
            )
        axes.set_ylim(bottom=0)
        frames_s = np.asarray(frame_times_us, dtype=float) / 1e6
        if len(frames_s):
            axes.plot(
                frames_s,
                np.zeros(len(frames_s)),
                "|",
                color="#777777",
                markersize=7,
                clip_on=False,
                label="video frames",
            )
        axes.set(
            xlabel="time, s",
            ylabel="events per pixel and second\n(closer to the real sensor is better)",
        )
        axes.margins(x=0)
        drawing.legend(loc="outside upper left", ncols=min(len(rates) + 1, 7))
    return drawing


def score_curve(
    curve: ArrayLike, *, warmup: int, window_us: int, ceiling: float | None = None
) -> Figure:
    """EQS of every window over time.

    Args:
        curve: score of every window from the start on, shape (windows,).
        warmup: windows at the start that do not count, drawn pale.
        window_us: length of a window.
        ceiling: what the real stream, slightly thinned, scores; drawn as a line.
    """
    values = np.asarray(curve, dtype=float)
    ends_s = np.arange(1, len(values) + 1) * window_us / 1e6
    with mpl.rc_context(STYLE):
        drawing = figure(9, 3.2)
        axes = drawing.subplots()
        axes.plot(ends_s[: warmup + 1], values[: warmup + 1], color="#bbbbbb", label="warm-up")
        axes.plot(ends_s[warmup:], values[warmup:], color="#1f4e79", label="EQS of the window")
        if ceiling is not None:
            axes.axhline(ceiling, color="#777777", linestyle="--", linewidth=1, label="ceiling")
        axes.set(xlabel="time, s", ylabel="EQS (higher is better)")
        axes.margins(x=0)
        drawing.legend(loc="outside upper left", ncols=3)
    return drawing


def learning_curves(curves: Mapping[str, Sequence[tuple[float, float]]]) -> Figure:
    """Accuracy over wall time: for each training its points (seconds, mAP in [0, 1])."""
    with mpl.rc_context(STYLE):
        drawing = figure(7, 4)
        axes = drawing.subplots()
        for at, (name, points) in enumerate(curves.items()):
            seconds, values = np.array(points, dtype=float).reshape(-1, 2).T
            axes.plot(seconds / 60, 100 * values, marker=MARKERS[at % len(MARKERS)], label=name)
        axes.set(xlabel="minutes of training", ylabel="mAP on the validation split")
        axes.set_ylim(bottom=0)
        axes.legend(fontsize=8)
    return drawing
