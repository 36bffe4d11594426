"""What the tests of single simulators share."""

import math
from collections import Counter

import numpy as np


def still(level, frames, size):
    """Frames of a scene in which nothing happens."""
    return np.full((frames, size, size), level, np.uint8)


def rows(events):
    """Events as a sorted list of (t, y, x, p)."""
    fields = (events.t, events.y, events.x, events.p)
    return sorted(zip(*(field.tolist() for field in fields), strict=True))


def assert_agree(events, expected, least):
    """The same events but for ties that a rounding error decides, and not too few."""
    found = rows(events)
    common = (Counter(found) & Counter(expected)).total()
    assert common > 0.99 * max(len(found), len(expected))
    assert common > least


def assert_poisson(count, expected):
    """A count within four standard deviations of a Poisson distribution's mean."""
    assert abs(count - expected) < 4 * math.sqrt(expected)
