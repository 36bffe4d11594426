"""What is said about a file that it does not say itself."""

from __future__ import annotations

from dataclasses import dataclass

UNITS_US = {"s": 1e6, "ms": 1e3, "us": 1.0, "ns": 1e-3}


@dataclass(frozen=True, kw_only=True)
class Hints:
    """Answers to what a file may leave open; None where nobody says.

    Args:
        height: rows of the sensor.
        width: columns of the sensor.
        order: order of the columns of a table without names, for instance `txyp`.
        time_unit: unit of a table's times, where they are whole numbers: s, ms, us or ns.
        first_pixel: number of the first row and column in a MATLAB file, 0 or 1.

    Raises:
        ValueError: the order, the unit or the number is none of these.
    """

    height: int | None = None
    width: int | None = None
    order: str | None = None
    time_unit: str | None = None
    first_pixel: int | None = None

    def __post_init__(self) -> None:
        """Check what is said."""
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


NOTHING_SAID = Hints()
