"""Improved ESIM: the circuit's low-pass, an exact leak, reset to the signal."""

from eqs.simulators.improved_esim.parameters import ImprovedESIM
from eqs.simulators.improved_esim.pixels import ImprovedESIMPixels

# The modes differ in the parameters' own currents and leaks, not in the pixels.
ImprovedESIM.pixels = dict.fromkeys(("fixed", "faithful"), ImprovedESIMPixels)

__all__ = ["ImprovedESIM"]
