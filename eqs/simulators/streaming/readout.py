"""Readout arbiters: events wait until the sensor's bus can carry them.

Joubert, Marcireau, Ralph, Jolley, van Schaik and Cohen, "Event Camera Simulator Improvements via
Characterized Parameters", Frontiers in Neuroscience 2021, whose program IEBCS offers a bottleneck,
a readout by rows and a synchronous one.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass, fields
from typing import Any, ClassVar, NamedTuple

import numpy as np

from eqs.simulators.streaming.arbiters import (
    PICOSECONDS,
    WAITS,
    Keys,
    Stamps,
    by_the_clock,
    one_by_one,
    row_by_row,
)
from eqs.simulators.streaming.keys import TIME_SHIFT, ordered

LAST_US = (1 << (63 - TIME_SHIFT)) - 1  # an event key holds no later time: 19 hours
_ALL_BUT_TIME = (1 << TIME_SHIFT) - 1


class Bus(NamedTuple):
    """What an arbiter remembers of the events that left."""

    free_ps: int = 0
    """When the next event may leave."""
    row: int = -1
    """The row that was served last."""


@dataclass(frozen=True, kw_only=True)
class Readout(ABC):
    """The way in which events leave a sensor.

    Nothing is lost: events that come faster than they can leave wait, if need be beyond the last
    frame. A subclass is a frozen dataclass of times in microseconds.

    Convention: an arbiter counts whole picoseconds from the first frame on, so that times well
    below a microsecond are exact and their sums do not drift. An event arises at the start of the
    microsecond that it is stamped with, and gets the stamp of the microsecond in which it leaves.
    Waiting does not act back on the pixels.

    Raises:
        ValueError: a time is not between a picosecond and a second.
    """

    kind: ClassVar[str]

    def __post_init__(self) -> None:
        """Check the times."""
        for name, value in asdict(self).items():
            if not (isinstance(value, int | float) and 1 / PICOSECONDS <= value <= 1e6):
                raise ValueError(
                    f"Expected {name} from 0.000001 to 1000000, got {value!r}; set readout.{name}"
                )

    def parameters(self) -> dict[str, Any]:
        """Everything that changes the events, as plain values."""
        return {"kind": self.kind, **asdict(self)}

    @abstractmethod
    def departures(
        self, keys: Keys, size: tuple[int, int], bus: Bus, until_us: int
    ) -> tuple[Stamps, Bus]:
        """When each event leaves, or WAITS if not before `until_us`.

        Args:
            keys: all events that wait or arise before `until_us`, in the order of their times.
            size: height and width of the sensor.
            bus: left behind by the events before these.
            until_us: events that arise from here on are not known yet.

        Returns:
            The microseconds in which they leave, and the bus afterwards.
        """


@dataclass(frozen=True, kw_only=True)
class Bottleneck(Readout):
    """Events leave one by one, first come first served.

    Convention: those of one microsecond come in the order of the stream, row by row.

    Args:
        service_us: shortest time between two events; its inverse is the bandwidth in Mev/s.

    Raises:
        ValueError: as for `Readout`.

    Example:
        >>> from eqs.simulators import ESIM
        >>> frames = np.array([[[64.0, 64.0]], [[128.0, 128.0]]])
        >>> slow = ESIM(readout=Bottleneck(service_us=10), log_offset=1e-9)
        >>> slow.simulate(frames, [0, 70_000]).t.tolist()
        [20197, 20207, 40395, 40405, 60593, 60603]
    """

    kind: ClassVar[str] = "bottleneck"

    service_us: float = 0.08

    def departures(
        self, keys: Keys, size: tuple[int, int], bus: Bus, until_us: int
    ) -> tuple[Stamps, Bus]:
        """See `Readout`."""
        service_ps, until_ps = _picoseconds(self.service_us), until_us * PICOSECONDS
        stamps, free_ps = one_by_one(keys, service_ps, bus.free_ps, until_ps)
        return stamps, Bus(free_ps)


@dataclass(frozen=True, kw_only=True)
class RowReadout(Readout):
    """Events leave row by row: all that wait in one, then all in the next one where any wait.

    Convention: rows are served from the top down and then from the top again, beginning at the
    first; what arises in a row while it is served waits for the next round.

    Args:
        service_us: shortest time between two rows.

    Raises:
        ValueError: as for `Readout`.

    Example:
        >>> from eqs.simulators import ESIM
        >>> frames = np.array([np.full((2, 2), level) for level in (64.0, 128.0)])
        >>> slow = ESIM(readout=RowReadout(service_us=10), log_offset=1e-9)
        >>> slow.simulate(frames, [0, 50_000]).t.tolist()[:4]
        [14426, 14426, 14436, 14436]
    """

    kind: ClassVar[str] = "row"

    service_us: float = 0.2

    def departures(
        self, keys: Keys, size: tuple[int, int], bus: Bus, until_us: int
    ) -> tuple[Stamps, Bus]:
        """See `Readout`."""
        service_ps, until_ps = _picoseconds(self.service_us), until_us * PICOSECONDS
        stamps, free_ps, row = row_by_row(keys, size, service_ps, *bus, until_ps)
        return stamps, Bus(free_ps, row)


@dataclass(frozen=True, kw_only=True)
class SynchronousReadout(Readout):
    """A clock visits one row per tick, from the top down and then from the top again.

    An event leaves when its row is next visited, so all stamps are multiples of the period and no
    event waits longer than one scan of the sensor, however many there are.

    Convention: the first row is visited at the first frame; what arises at a tick leaves with it.

    Args:
        period_us: time between two ticks.

    Raises:
        ValueError: as for `Readout`.

    Example:
        >>> from eqs.simulators import ESIM
        >>> frames = np.array([np.full((2, 1), level) for level in (64.0, 128.0)])
        >>> clocked = ESIM(readout=SynchronousReadout(period_us=1000), log_offset=1e-9)
        >>> clocked.simulate(frames, [0, 70_000]).t.tolist()
        [21000, 22000, 41000, 42000, 61000, 62000]
    """

    kind: ClassVar[str] = "synchronous"

    period_us: float = 1.0

    def departures(
        self, keys: Keys, size: tuple[int, int], bus: Bus, until_us: int
    ) -> tuple[Stamps, Bus]:
        """See `Readout`."""
        period_ps, until_ps = _picoseconds(self.period_us), until_us * PICOSECONDS
        return by_the_clock(keys, size, period_ps, until_ps), bus


class WaitingEvents:
    """The events that have arisen in a sensor and not left it yet.

    They are all held in memory and looked through at each frame: a readout that is too slow for its
    scene costs more with every frame.
    """

    def __init__(self, readout: Readout, size: tuple[int, int]) -> None:
        """Start with nothing waiting."""
        self.readout = readout
        self.size = size
        self.bus = Bus()
        self.keys = np.empty(0, np.int64)

    def push(self, keys: Keys, watermark_us: int) -> Keys:
        """Take all events that arise before the watermark, and give those that leave before it.

        Both are sorted. What leaves later comes with a later call.
        """
        keys = np.concatenate([self.keys, keys])
        stamps, self.bus = self.readout.departures(keys, self.size, self.bus, watermark_us)
        leaves = stamps != WAITS
        self.keys, stamps = keys[~leaves], stamps[leaves]
        restamped = (stamps << TIME_SHIFT) | (keys[leaves] & _ALL_BUT_TIME)
        return ordered(restamped, int(stamps.min(initial=watermark_us)))

    def flush(self, keys: Keys) -> Keys:
        """Take the last events and give all that still wait.

        Raises:
            ValueError: they would wait for longer than a time can say.
        """
        rest = self.push(keys, LAST_US)
        if len(self.keys):
            times = " or ".join(f"readout.{field.name}" for field in fields(self.readout))
            raise ValueError(
                f"Expected a readout that is done after {LAST_US} us, got {len(self.keys)} events "
                f"that still wait; lower {times}"
            )
        return rest


def _picoseconds(time_us: float) -> int:
    return round(time_us * PICOSECONDS)
