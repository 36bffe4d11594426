"""Cheap rivals of EQS: if one of them predicts as well, EQS is not needed.

Convention: of a name that ends in `_error` or `_distance` lower is better, of any other higher.
"""

from eqs.metrics.baselines.all import baselines
from eqs.metrics.baselines.features import FeatureFrechet
from eqs.metrics.baselines.points import point_baselines
from eqs.metrics.baselines.rates import log_rate_error, polarity_error, rate_map_correlation
from eqs.metrics.baselines.tensors import tensor_baselines
from eqs.metrics.baselines.timing import interval_distance, phase_locking_error

__all__ = [
    "FeatureFrechet",
    "baselines",
    "interval_distance",
    "log_rate_error",
    "phase_locking_error",
    "point_baselines",
    "polarity_error",
    "rate_map_correlation",
    "tensor_baselines",
]
