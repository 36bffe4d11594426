"""Event-camera simulators: frames in, events out, one module per published model."""

from eqs.simulators.base import Recorded, Simulator, Stream
from eqs.simulators.esim import ESIM

__all__ = ["ESIM", "Recorded", "Simulator", "Stream"]
