"""What a network sees of an event stream."""

from eqs.representations.histogram import stacked_histogram

__all__ = ["stacked_histogram"]
