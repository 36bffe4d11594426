"""What things in the street are made of: of use to whoever renders more than one wavelength."""

from __future__ import annotations

from enum import IntEnum


class Substance(IntEnum):
    """What a surface is made of; how bright it is says its albedo."""

    ASPHALT = 0
    PAVING = 1
    WHITE_PAINT = 2
    BRICK = 3
    PLASTER = 4
    FOLIAGE = 5
    BARK = 6
    CAR_PAINT = 7
    GLASS = 8
    RUBBER = 9
    METAL = 10
    HEADLAMP = 11
    TAIL_LAMP = 12
    CLOTH = 13
    DENIM = 14
    SKIN = 15
    HAIR = 16
    EARTH = 17
