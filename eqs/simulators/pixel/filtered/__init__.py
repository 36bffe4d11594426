"""Pixels that compare what their filters give with the level that they remember.

The photoreceptor follows the light by a law of `light_dependent`, one more pole may follow, and the
comparator fires where the result has left the memory by a threshold. Noise blurs the time stamps,
and fires where the signal alone does not.
"""

from eqs.simulators.pixel.filtered.circuit import Circuit, Seen
from eqs.simulators.pixel.filtered.pixels import FilteredPixels

__all__ = ["Circuit", "FilteredPixels", "Seen"]
