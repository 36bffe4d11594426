"""The detector's input with gradients: counts that follow event times and weights smoothly."""

from __future__ import annotations

import torch
from torch import Tensor


def soft_histogram(
    t: Tensor,
    x: Tensor,
    y: Tensor,
    p: Tensor,
    weights: Tensor | None = None,
    *,
    bins: int = 10,
    start_us: float,
    stop_us: float,
    height: int,
    width: int,
    count_cutoff: float | None = 10.0,
    hard: bool = False,
) -> Tensor:
    """Share every event between the two time bins whose middles it lies between.

    Gradients reach `t`, as the difference of what the two bins are worth, and `weights`; they stop
    at `x`, `y` and `p`, which are places, and where a count has passed the cutoff. An event moved
    over the end of the window changes nothing smoothly: it leaves.

    Convention: channels are those of `stacked_histogram`, `p * bins + bin`. Before the middle of
    the first bin and after that of the last an event counts for that bin alone, so a window's sum
    is that of its weights. With `hard` the values are those of `stacked_histogram`, an event
    counting wholly for its own bin, and only the gradients are those of the shared counts (a
    straight-through estimate).

    Args:
        t: times in microseconds, floating, shape (n,), in any order.
        x: columns, whole numbers, shape (n,).
        y: rows, whole numbers, shape (n,).
        p: 1 for brighter, 0 for darker, shape (n,).
        weights: how much each event counts, shape (n,); one each if None.
        bins: time bins per polarity.
        start_us: start of the window.
        stop_us: end of the window, not part of it.
        height: rows of the sensor.
        width: columns of the sensor.
        count_cutoff: counts stop growing here; None lets them grow.
        hard: give hard counts with soft gradients.

    Returns:
        Counts (2 * bins, height, width) of the type of `t`.

    Raises:
        ValueError: times are not floating, or the window is empty.

    Example:
        >>> t = torch.tensor([50.0], requires_grad=True)
        >>> zero = torch.zeros(1, dtype=torch.long)
        >>> span = {"start_us": 0, "stop_us": 100, "height": 1, "width": 1}
        >>> soft_histogram(t, zero, zero, zero, bins=2, **span)[:2].flatten().tolist()
        [0.5, 0.5]
    """
    if not t.is_floating_point() or stop_us <= start_us:
        raise ValueError(
            f"Expected floating times and a window that ends after it starts, got {t.dtype} and "
            f"{start_us} to {stop_us} us"
        )
    weights = torch.ones_like(t) if weights is None else weights
    weights = weights * ((t >= start_us) & (t < stop_us))
    place = (t - start_us) * (bins / (stop_us - start_us))
    soft = _shared(place, x, y, p, weights, bins, height, width)
    if count_cutoff is not None:
        soft = soft.clamp(max=count_cutoff)
    if not hard:
        return soft
    with torch.no_grad():
        own = place.floor().clamp(0, bins - 1) + 0.5  # in the middle of its bin nothing is shared
        counts = _shared(own, x, y, p, weights, bins, height, width)
        if count_cutoff is not None:
            counts = counts.clamp(max=count_cutoff)
    return soft + (counts - soft).detach()


def _shared(
    place: Tensor,
    x: Tensor,
    y: Tensor,
    p: Tensor,
    weights: Tensor,
    bins: int,
    height: int,
    width: int,
) -> Tensor:
    """Counts of events at places from 0 to `bins`, shared between neighbouring middles."""
    inside = (place - 0.5).clamp(0.0, bins - 1.0)
    lower = inside.detach().floor().clamp(max=max(bins - 2, 0)).long()
    share = inside - lower
    upper = (lower + 1).clamp(max=bins - 1)
    flat = place.new_zeros(2 * bins * height * width)
    for number, part in ((lower, weights * (1.0 - share)), (upper, weights * share)):
        index = ((p.long() * bins + number) * height + y.long()) * width + x.long()
        flat = flat.index_add(0, index, part)
    return flat.view(2 * bins, height, width)
