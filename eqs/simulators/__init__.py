"""Event-camera simulators: frames in, events out; a room or a file for each published model.

`pixel` holds what several models' pixels are made of, `streaming` what every clip passes through:
bands, keys, order, readout. Whoever writes a simulator finds all of it here.
"""

from eqs.simulators.adv2e import ADV2E
from eqs.simulators.base import Simulator, require_not_negative, require_positive
from eqs.simulators.dvs_pixel import DVSPixel
from eqs.simulators.dvs_voltmeter import DVSVoltmeter
from eqs.simulators.esim import CARLA, ESIM, Vid2E
from eqs.simulators.gazebo import Gazebo
from eqs.simulators.icns import ICNS
from eqs.simulators.improved_esim import ImprovedESIM
from eqs.simulators.learned import EventGAN, Learning, VolumeNetwork
from eqs.simulators.pecs import PECS
from eqs.simulators.pix2nvs import PIX2NVS
from eqs.simulators.pixel.crossing import fire_levels, firing_pixels
from eqs.simulators.pixel.photoreceptor import filter_share, lin_log, log_intensity
from eqs.simulators.pixel.randomness import (
    draw_key,
    normal,
    normal_map,
    uniform,
    uniform_map,
    word_at,
)
from eqs.simulators.pixel.thresholds import threshold_map
from eqs.simulators.prophesee import Prophesee
from eqs.simulators.streaming.keys import event_key, with_room
from eqs.simulators.streaming.pixels import Interval, Pixels
from eqs.simulators.streaming.readout import Bottleneck, Readout, RowReadout, SynchronousReadout
from eqs.simulators.streaming.stream import Stream
from eqs.simulators.v2e import V2E

__all__ = [
    "ADV2E",
    "CARLA",
    "ESIM",
    "ICNS",
    "PECS",
    "PIX2NVS",
    "V2E",
    "Bottleneck",
    "DVSPixel",
    "DVSVoltmeter",
    "EventGAN",
    "Gazebo",
    "ImprovedESIM",
    "Interval",
    "Learning",
    "Pixels",
    "Prophesee",
    "Readout",
    "RowReadout",
    "Simulator",
    "Stream",
    "SynchronousReadout",
    "Vid2E",
    "VolumeNetwork",
    "draw_key",
    "event_key",
    "filter_share",
    "fire_levels",
    "firing_pixels",
    "lin_log",
    "log_intensity",
    "normal",
    "normal_map",
    "require_not_negative",
    "require_positive",
    "threshold_map",
    "uniform",
    "uniform_map",
    "with_room",
    "word_at",
]
