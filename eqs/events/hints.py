"""What is said about a file that it does not say itself."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

UNITS_US = {"s": 1e6, "ms": 1e3, "us": 1.0, "ns": 1e-3}
STAMPS = ("event", "header")


@dataclass(frozen=True, kw_only=True)
class Hints:
    """Answers to what a file may leave open; None where nobody says.

    Args:
        height: rows of the sensor.
        width: columns of the sensor.
        order: order of the columns of a table without names, for instance `txyp`.
        time_unit: unit of a table's times, where they are whole numbers: s, ms, us or ns.
        first_pixel: number of the first row and column in a MATLAB file, 0 or 1.
        topics: topics of a bag that are meant, where it holds several of a kind.
        stamp: whose time counts in a bag's arrays of events: each `event`'s own, or that of the
            `header` of its message.
        invert_polarity: whether the file calls darker what is called brighter here.

    Raises:
        ValueError: the order, the unit, the number or the stamp is none of these.
    """

    height: int | None = None
    width: int | None = None
    order: str | None = None
    time_unit: str | None = None
    first_pixel: int | None = None
    topics: tuple[str, ...] = ()
    stamp: str = "event"
    invert_polarity: bool = False

    def __post_init__(self) -> None:
        """Check what is said."""
        named = (self.topics,) if isinstance(self.topics, str) else tuple(self.topics)
        object.__setattr__(self, "topics", named)
        if self.order is not None and sorted(self.order) != sorted("txyp"):
            raise ValueError(
                f"Expected an order of t, x, y and p, got {self.order!r}; set order=txyp"
            )
        if self.time_unit is not None and self.time_unit not in UNITS_US:
            raise ValueError(
                f"Expected a unit among {', '.join(UNITS_US)}, got {self.time_unit!r}; "
                "set time_unit"
            )
        if self.first_pixel not in (None, 0, 1):
            raise ValueError(
                f"Expected the first pixel to be 0 or 1, got {self.first_pixel}; set first_pixel"
            )
        if self.stamp not in STAMPS:
            raise ValueError(
                f"Expected a stamp among {', '.join(STAMPS)}, got {self.stamp!r}; set stamp"
            )

    def record(self) -> dict[str, Any]:
        """What was said, for the names of files that were made by it.

        What says nothing about bags leaves it out, so that files made before bags could be spoken
        of keep their names.

        Example:
            >>> Hints(order="txyp").record() == Hints(order="txyp", stamp="header").record()
            False
            >>> [*Hints().record()]
            ['height', 'width', 'order', 'time_unit', 'first_pixel']
        """
        said = asdict(self)
        unsaid = {"topics": (), "stamp": "event", "invert_polarity": False}
        return {name: value for name, value in said.items() if unsaid.get(name, ...) != value}


NOTHING_SAID = Hints()
