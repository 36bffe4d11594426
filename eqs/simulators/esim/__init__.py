"""ESIM and the simulators that share its pixel: CARLA's camera, and Vid2E's upsampled clips."""

from eqs.simulators.esim.carla import CARLA
from eqs.simulators.esim.faithful import FaithfulESIMPixels
from eqs.simulators.esim.fixed import ESIMPixels
from eqs.simulators.esim.parameters import ESIM
from eqs.simulators.esim.vid2e import Vid2E

ESIM.pixels = {"fixed": ESIMPixels, "faithful": FaithfulESIMPixels}

__all__ = ["CARLA", "ESIM", "Vid2E"]
