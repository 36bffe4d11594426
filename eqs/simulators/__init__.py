"""Event-camera simulators: frames in, events out, one module per published model."""

from eqs.simulators.base import Recorded, Simulator
from eqs.simulators.carla import CARLA
from eqs.simulators.dvs_voltmeter import DVSVoltmeter
from eqs.simulators.esim import ESIM
from eqs.simulators.gazebo import Gazebo
from eqs.simulators.icns import ICNS
from eqs.simulators.improved_esim import ImprovedESIM
from eqs.simulators.pix2nvs import PIX2NVS
from eqs.simulators.prophesee import Prophesee
from eqs.simulators.readout import Bottleneck, Readout, RowReadout, SynchronousReadout
from eqs.simulators.stream import Stream
from eqs.simulators.v2e import V2E
from eqs.simulators.vid2e import Vid2E

__all__ = [
    "CARLA",
    "ESIM",
    "ICNS",
    "PIX2NVS",
    "V2E",
    "Bottleneck",
    "DVSVoltmeter",
    "Gazebo",
    "ImprovedESIM",
    "Prophesee",
    "Readout",
    "Recorded",
    "RowReadout",
    "Simulator",
    "Stream",
    "SynchronousReadout",
    "Vid2E",
]
