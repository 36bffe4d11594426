"""ICNS: latency, jitter, a time constant that shrinks with the light, background."""

from eqs.simulators.icns.faithful import FaithfulICNSPixels
from eqs.simulators.icns.fixed import ICNSPixels
from eqs.simulators.icns.parameters import ICNS

ICNS.pixels = {"fixed": ICNSPixels, "faithful": FaithfulICNSPixels}

__all__ = ["ICNS", "ICNSPixels"]
