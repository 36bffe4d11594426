"""V2E: finite bandwidth, mismatch, leak, shot noise, refractory period."""

from eqs.simulators.v2e.faithful import FaithfulV2EPixels
from eqs.simulators.v2e.fixed import V2EPixels
from eqs.simulators.v2e.parameters import V2E

V2E.pixels = {"fixed": V2EPixels, "faithful": FaithfulV2EPixels}

__all__ = ["V2E"]
