"""The street of `dsec_mini`, ray traced through a lens and in colour, by Mitsuba 3."""

from eqs.scenes.traced.camera import Lens
from eqs.scenes.traced.street import TracedStreet

__all__ = ["Lens", "TracedStreet"]
