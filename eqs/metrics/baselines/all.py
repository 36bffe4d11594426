"""All baselines of one pair of streams."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eqs.events import Events
from eqs.metrics.baselines.points import point_baselines
from eqs.metrics.baselines.rates import log_rate_error, polarity_error, rate_map_correlation
from eqs.metrics.baselines.tensors import tensor_baselines
from eqs.metrics.baselines.timing import interval_distance, phase_locking_error
from eqs.metrics.definition import Definition
from eqs.metrics.windows import check_sensors, histogram_chunks, window_starts


def baselines(
    simulated: Events,
    real: Events,
    definition: Definition,
    *,
    start_us: int,
    stop_us: int,
    frame_times_us: NDArray[np.int64] | None,
) -> dict[str, float]:
    """Every baseline by its name, over the windows that the score itself looks at.

    Args:
        simulated: stream to judge.
        real: stream of the real sensor, same size and clock.
        definition: windows, bins and cutoff.
        start_us: start of the first window.
        stop_us: time that no window may pass.
        frame_times_us: times of the video frames, rising, at least two; None where there are none,
            which leaves out what asks for their beat.

    Raises:
        ValueError: the sensors differ, or no whole window fits.
    """
    check_sensors([simulated, real])
    starts = window_starts([real, simulated], definition.window_us, start_us, stop_us)
    first, last = int(starts[0]), int(starts[-1]) + definition.window_us
    simulated, real = simulated.window(first, last), real.window(first, last)
    window = definition.window_us
    beats = {}
    if frame_times_us is not None:
        beats["phase_locking_error"] = phase_locking_error(simulated, real, frame_times_us)
    return {
        "log_rate_error": log_rate_error(simulated, real),
        "polarity_error": polarity_error(simulated, real),
        "rate_map_correlation": rate_map_correlation(simulated, real),
        "interval_distance": interval_distance(simulated, real),
        **beats,
        **tensor_baselines(
            histogram_chunks([simulated, real], starts, definition), definition.count_cutoff
        ),
        **point_baselines(simulated, real, start_us=first, window_us=window, windows=len(starts)),
    }
