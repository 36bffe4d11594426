"""DVS-Voltmeter: a voltage that drifts and diffuses between two barriers."""

from eqs.simulators.dvs_voltmeter.parameters import DVSVoltmeter
from eqs.simulators.dvs_voltmeter.pixels import DVSVoltmeterPixels

# The modes differ in single steps, which the pixels look up.
DVSVoltmeter.pixels = dict.fromkeys(("fixed", "faithful"), DVSVoltmeterPixels)

__all__ = ["DVSVoltmeter"]
