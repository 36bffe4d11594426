"""Several event streams cut into the same windows, as histograms for one batched pass."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from eqs.events import EventReader, Events
from eqs.events.loaded import LoadedEvents
from eqs.metrics.definition import Definition
from eqs.metrics.grid import Grid
from eqs.representations import stacked_histogram

# Pixels of all frames in one pass of the backbone. Eight 640x480 frames keep the first stage's
# activations below half a gigabyte, and small sensors still come in long, efficient chunks.
PIXELS_PER_CHUNK = 8 * 480 * 640
LONGEST_CHUNK = 32

# The mean of DSEC: 10.6 million events per second on 640 x 480 pixels.
EVENTS_PER_PIXEL_AND_SECOND = 35.0


# A stream in memory or in a file, or its histograms (windows, 2 * bins, height, width).
EventStream = Events | EventReader | LoadedEvents
StreamOrHistograms = EventStream | Tensor


def check_sensors(streams: Sequence[EventStream]) -> None:
    """Refuse streams of different sensors.

    Raises:
        ValueError: the sensor sizes differ.
    """
    sizes = [f"{stream.width}x{stream.height}" for stream in streams]
    if len(set(sizes)) > 1:
        raise ValueError(
            f"Expected streams of one sensor size, got {' and '.join(dict.fromkeys(sizes))}; "
            "simulate at the size of the real sensor"
        )


def common_grid(
    streams: Sequence[EventStream],
    window_us: int,
    start_us: int | None = None,
    stop_us: int | None = None,
) -> Grid:
    """The windows in which streams are compared, by the one rule of every command.

    Convention: the reference sets the limits, with its span or else its first and last event, and a
    candidate narrows them only where it states a span of its own. So a simulator that fires late,
    or not at all, is scored as silent for so long and not over what is left. Where the reference
    has neither span nor events the candidates' events set the limits. A remainder shorter than a
    window is dropped.

    Args:
        streams: streams on one clock, the reference first.
        window_us: length of a window in microseconds.
        start_us: start of the first window, instead of the limits.
        stop_us: time that no window may pass, instead of the limits.

    Raises:
        ValueError: the streams do not overlap in time, the overlap is shorter than one window, or
            no stream has events and a limit is missing.
    """
    found = _limits(streams, given=start_us is not None or stop_us is not None)
    if found is None and (start_us is None or stop_us is None):
        raise ValueError(
            "Expected events in at least one stream, got none; give start_us and stop_us"
        )
    first, last = found or (0, 0)
    start = first if start_us is None else start_us
    stop = last if stop_us is None else stop_us
    if stop <= start:
        raise ValueError(
            f"Expected streams that overlap in time, got a common stretch from {start} us to "
            f"{stop} us; put both on one clock, for instance with Events.shifted"
        )
    count = (stop - start) // window_us
    if count < 1:
        raise ValueError(
            f"Expected at least one window of {window_us} us, got an overlap of {stop - start} us; "
            "give longer streams or set eqs.window_us"
        )
    return Grid(start_us=start, window_us=window_us, count=count, extent_us=streams[0].extent_us)


def _limits(streams: Sequence[EventStream], given: bool) -> tuple[int, int] | None:
    """Start and stop of what the streams share; stop before start where they do not meet.

    Events tell the clock of a candidate that states no span: it meets the others or is on another
    clock. Whoever names a limit, `given`, relies on a common clock, as a stated span does.
    """
    reference, *candidates = streams
    events = [each.extent_us for each in candidates if each.span_us is None]
    unstated = [extent for extent in events if extent is not None]
    stated = [reference.extent_us, *(each.span_us for each in candidates)]
    extents = [extent for extent in stated if extent is not None] or unstated
    if not extents:
        return None
    start, stop = max(first for first, _ in extents), min(last for _, last in extents)
    for first, last in unstated:
        if not given and (first >= stop or last <= start):
            start, stop = max(start, first), min(stop, last)
    return start, stop


def window_starts(
    streams: Sequence[EventStream],
    window_us: int,
    start_us: int | None = None,
    stop_us: int | None = None,
) -> NDArray[np.int64]:
    """Start times of the windows of `common_grid`, whose arguments and errors these are."""
    return common_grid(streams, window_us, start_us, stop_us).starts_us


def chunk_length(streams: int, height: int, width: int) -> int:
    """Windows per pass that keep the memory of a pass about constant."""
    return max(1, min(LONGEST_CHUNK, PIXELS_PER_CHUNK // (streams * height * width)))


def group_chunks(
    streams: Sequence[StreamOrHistograms],
    definition: Definition,
    *,
    start_us: int | None = None,
    stop_us: int | None = None,
    chunk_windows: int | None = None,
) -> tuple[Iterator[Tensor], int]:
    """Histograms of streams side by side, and the number of windows they share.

    Args:
        streams: event streams of one sensor on one clock, or histograms of one shape
            (windows, 2 * bins, height, width).
        definition: bins, window length, cutoff and span.
        start_us: start of the first window, for event streams.
        stop_us: time that no window may pass, for event streams.
        chunk_windows: windows per chunk; chosen from the sensor size if None.

    Returns:
        Chunks of shape (windows, streams, 2 * bins, height, width), and the windows in all.

    Raises:
        ValueError: streams and histograms are mixed, shapes or sensors differ, or the streams do
            not share a whole window.
    """
    tensors = [stream for stream in streams if isinstance(stream, Tensor)]
    if not tensors:
        events = [stream for stream in streams if not isinstance(stream, Tensor)]
        check_sensors(events)
        starts = window_starts(events, definition.window_us, start_us, stop_us)
        return histogram_chunks(events, starts, definition, chunk_windows), len(starts)
    if len(tensors) < len(streams):
        raise ValueError("Expected event streams or histograms, got both; convert one of them")
    _check_histograms(tensors, definition.bins)
    return _tensor_chunks(tensors, chunk_windows), len(tensors[0])


def _check_histograms(tensors: Sequence[Tensor], bins: int) -> None:
    shapes = [tuple(tensor.shape) for tensor in tensors]
    if len(set(shapes)) > 1:
        raise ValueError(
            f"Expected histograms of one shape, got {' and '.join(map(str, dict.fromkeys(shapes)))}"
        )
    if len(shapes[0]) != 4 or shapes[0][1] != 2 * bins or not shapes[0][0]:
        raise ValueError(
            f"Expected histograms of shape (windows, {2 * bins}, height, width) with at least one "
            f"window, got {shapes[0]}; set eqs.bins"
        )
    if not all(torch.isfinite(tensor).all() for tensor in tensors if tensor.is_floating_point()):
        raise ValueError("Expected finite histograms, got NaN or infinity")


def _tensor_chunks(tensors: Sequence[Tensor], chunk_windows: int | None) -> Iterator[Tensor]:
    length = chunk_windows or chunk_length(len(tensors), *map(int, tensors[0].shape[-2:]))
    for first in range(0, len(tensors[0]), length):
        yield torch.stack([tensor[first : first + length] for tensor in tensors], dim=1)


def histogram_chunks(
    streams: Sequence[EventStream],
    starts_us: NDArray[np.int64],
    definition: Definition,
    chunk_windows: int | None = None,
) -> Iterator[Tensor]:
    """The streams' histograms, a few windows at a time.

    Args:
        streams: streams of one sensor size.
        starts_us: start time of each window.
        definition: bins, window length, cutoff and span.
        chunk_windows: windows per chunk; chosen from the sensor size if None.

    Yields:
        uint8 of shape (windows, streams, 2 * bins, height, width).
    """
    length = chunk_windows or chunk_length(len(streams), streams[0].height, streams[0].width)
    for first in range(0, len(starts_us), length):
        chunk = [
            [_histogram(stream, int(start), definition) for stream in streams]
            for start in starts_us[first : first + length]
        ]
        yield torch.from_numpy(np.stack([np.stack(windows) for windows in chunk]))


def normalised_counts(histograms: Tensor, definition: Definition) -> Tensor:
    """Histograms scaled so that each window of each stream has the same mean count.

    For backbones that see the scale of their input. RVT does not: its first convolution has no bias
    and a norm follows.

    Convention: the mean is that of `EVENTS_PER_PIXEL_AND_SECOND`, one number for all streams and
    not one between the two that are compared. So a window does not depend on what it is compared
    with: the score is symmetric, the real stream needs one pass for all candidates, and the mean
    real feature is computed at the same scale. Counts saturate at the cutoff as before, which
    leaves very sparse windows below the mean. A window without events stays as it is.

    Args:
        histograms: counts, float, shape (..., 2 * bins, height, width).
        definition: bins, window length and cutoff.

    Returns:
        Same shape.

    Example:
        >>> counts = torch.tensor([[[0.0, 1.0]], [[0.0, 2.0]]])
        >>> torch.equal(*(normalised_counts(n * counts, Definition(bins=1)) for n in (1, 4)))
        True
    """
    window_s = definition.window_us * 1e-6
    wanted = EVENTS_PER_PIXEL_AND_SECOND * window_s / (2 * definition.bins)
    mean = histograms.mean(dim=(-3, -2, -1), keepdim=True)
    scaled = histograms * (wanted / mean.masked_fill(mean == 0, 1.0))
    return scaled.clamp_max(definition.count_cutoff)


def _histogram(stream: EventStream, start_us: int, definition: Definition) -> NDArray[np.uint8]:
    stop_us = start_us + definition.window_us
    return stacked_histogram(
        stream.window(start_us, stop_us),
        bins=definition.bins,
        start_us=start_us,
        stop_us=stop_us,
        count_cutoff=definition.count_cutoff,
        span=definition.span,
    )
