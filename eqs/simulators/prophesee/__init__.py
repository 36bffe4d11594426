"""Prophesee: two-stage filter, mismatch, leak and shot noise around level crossings."""

from eqs.simulators.prophesee.faithful import FaithfulPropheseePixels
from eqs.simulators.prophesee.fixed import PropheseePixels
from eqs.simulators.prophesee.parameters import Prophesee

Prophesee.pixels = {"fixed": PropheseePixels, "faithful": FaithfulPropheseePixels}

__all__ = ["Prophesee"]
