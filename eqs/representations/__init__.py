"""What a network sees of an event stream."""

from eqs.representations.histogram import HISTOGRAM_VERSION, stacked_histogram
from eqs.representations.mixed_density import mixed_density_stack
from eqs.representations.soft_histogram import soft_histogram

__all__ = ["HISTOGRAM_VERSION", "mixed_density_stack", "soft_histogram", "stacked_histogram"]
