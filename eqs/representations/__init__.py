"""What a network sees of an event stream."""

from eqs.representations.histogram import stacked_histogram
from eqs.representations.mixed_density import mixed_density_stack

__all__ = ["mixed_density_stack", "stacked_histogram"]
