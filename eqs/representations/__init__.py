"""What a network sees of an event stream."""

from eqs.representations.histogram import stacked_histogram
from eqs.representations.mixed_density import mixed_density_stack
from eqs.representations.soft_histogram import soft_histogram

__all__ = ["mixed_density_stack", "soft_histogram", "stacked_histogram"]
