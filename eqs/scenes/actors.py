"""What stands and moves in the street: each kind of actor as a list of simple parts."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from eqs.scenes.parts import ATOP, BACK, BLOB, FRONT, LEFT, RIGHT, SHADOW, WHEEL, part, part_rows
from eqs.scenes.substances import Substance


@dataclass(frozen=True, kw_only=True)
class Actor:
    """One thing in the street: where it starts, how it moves and what it is made of.

    Args:
        x: metres right of the middle of the street, at time zero.
        z: metres along the street, at time zero.
        speed: metres per second along the heading.
        heading: radians from the street's direction towards its right.
        label: DSEC-Detection class id, -1 for unlabelled things.
        parts: rows of part columns, shape (n, PART_COLUMNS).
    """

    x: float
    z: float
    speed: float = 0.0
    heading: float = 0.0
    label: int = -1
    parts: NDArray[np.float64] = field(repr=False)

    def row(self) -> tuple[float, ...]:
        """The actor row the compiled code reads."""
        return (self.x, self.z, self.speed, self.heading, 0.0, float(self.label))


def _shadow(half_width: float, half_length: float) -> tuple[float, ...]:
    low = (0.0, 0.0, half_width, half_length, 0.0)
    return part(low, (*low[:4], 0.02), 0.7, mode=SHADOW)


def _wheels(
    positions: tuple[float, ...], half_width: float, radius: float
) -> list[tuple[float, ...]]:
    rows = []
    for side, seen_from in ((half_width, RIGHT), (-half_width, LEFT)):
        for forward in positions:
            disc = (side, forward, radius, 0.0, radius)
            hub = (side, forward, 0.5 * radius, 0.0, radius)
            rows.append(
                part(disc, albedo=0.03, shape=WHEEL, seen_from=seen_from, of=Substance.RUBBER)
            )
            rows.append(part(hub, albedo=0.35, shape=WHEEL, mode=ATOP, seen_from=seen_from))
    return rows


def _lamps(
    forward: float, side: float, up: float, size: float, seen_from: int, emit: float, albedo: float
) -> list[tuple[float, ...]]:
    half = (size, 0.01)
    return [
        part(
            (s * side, forward, *half, up - 0.6 * size),
            (s * side, forward, *half, up + 0.6 * size),
            albedo,
            mode=ATOP,
            seen_from=seen_from,
            emit=emit,
            of=Substance.HEADLAMP if seen_from == FRONT else Substance.TAIL_LAMP,
        )
        for s in (1.0, -1.0)
    ]


def car(
    paint: float, *, length: float = 4.3, height: float = 1.5, glass: float = 0.04, lit: bool
) -> NDArray[np.float64]:
    """A passenger car: body, glazed cabin, wheels, lights and number plate."""
    half, wide = 0.5 * length, 0.88
    body_top = 0.56 * height
    rows = [
        _shadow(wide + 0.15, half + 0.2),
        *_wheels((-0.31 * length, 0.31 * length), wide, 0.33),
        part(
            (0.0, 0.0, wide, half, 0.25),
            (0.0, 0.0, 0.95 * wide, 0.97 * half, body_top),
            paint,
            pane=0.0,
            of=Substance.CAR_PAINT,
        ),
        part(
            (0.0, -0.06 * length, 0.92 * wide, 0.30 * length, 0.97 * body_top),
            (0.0, -0.07 * length, 0.74 * wide, 0.19 * length, height),
            paint,
            pane=glass,
            of=Substance.CAR_PAINT,
        ),
        *_wheels((-0.31 * length, 0.31 * length), wide + 0.01, 0.31),
        *_lamps(half, 0.62, 0.62, 0.17, FRONT, 90.0 if lit else 0.0, 0.85),
        *_lamps(-half, 0.68, 0.68, 0.14, BACK, 9.0 if lit else 0.0, 0.10),
        part(
            (0.0, -half, 0.26, 0.01, 0.42),
            (0.0, -half, 0.26, 0.01, 0.54),
            0.85,
            mode=ATOP,
            seen_from=BACK,
            of=Substance.WHITE_PAINT,
        ),
    ]
    return part_rows(rows)


def truck(paint: float, box: float, *, length: float = 6.8, lit: bool) -> NDArray[np.float64]:
    """A delivery truck: a low cab in front of a tall box."""
    half, wide = 0.5 * length, 1.12
    cab = 0.5 * (half + half - 1.7)
    rows = [
        _shadow(wide + 0.15, half + 0.2),
        part(
            (0.0, 0.0, 0.8 * wide, 0.95 * half, 0.45),
            (0.0, 0.0, 0.8 * wide, half, 0.7),
            0.05,
            of=Substance.RUBBER,
        ),
        *_wheels((-0.55 * half, 0.68 * half), wide, 0.45),
        part(
            (0.0, cab, wide, 0.85, 0.5),
            (0.0, cab, wide, 0.82, 1.35),
            paint,
            pane=0.0,
            of=Substance.CAR_PAINT,
        ),
        part(
            (0.0, cab, wide, 0.82, 1.3),
            (0.0, cab - 0.15, 0.93 * wide, 0.6, 2.3),
            paint,
            pane=0.04,
            of=Substance.CAR_PAINT,
        ),
        part(
            (0.0, -0.9, wide + 0.03, half - 0.9, 0.75),
            (0.0, -0.9, wide + 0.03, half - 0.9, 3.1),
            box,
            pane=0.3 * box,  # painted sides
            of=Substance.PLASTER,
        ),
        *_wheels((-0.55 * half, 0.68 * half), wide + 0.04, 0.42),
        *_lamps(half, 0.8, 0.75, 0.18, FRONT, 90.0 if lit else 0.0, 0.85),
        *_lamps(-half, 0.9, 0.95, 0.14, BACK, 9.0 if lit else 0.0, 0.10),
    ]
    return part_rows(rows)


def pedestrian(
    coat: float, trousers: float, *, height: float = 1.75, gait: float = 0.0, phase: float = 0.0
) -> NDArray[np.float64]:
    """A person on foot; `gait` is the stride's rate in radians per second, zero when standing."""
    k = height / 1.75
    stride = 0.34 * k if gait > 0.0 else 0.04
    limb, arm = 0.085 * k, 0.06 * k
    rows = [_shadow(0.32, 0.32)]
    for side, offset in ((1.0, 0.0), (-1.0, np.pi)):
        rows.append(
            part(
                (0.1 * k * side, 0.0, limb, 0.09 * k, 0.0),
                (0.09 * k * side, 0.0, 1.25 * limb, 0.1 * k, 0.88 * k),
                trousers,
                of=Substance.DENIM,
                swing=(stride, gait, phase + offset, 0.1 * k),
            )
        )
    rows.append(
        part(
            (0.0, 0.0, 0.19 * k, 0.12 * k, 0.82 * k),
            (0.0, 0.0, 0.24 * k, 0.14 * k, 1.46 * k),
            coat,
            pane=0.0,
            of=Substance.CLOTH,
        )
    )
    for side, offset in ((1.0, np.pi), (-1.0, 0.0)):
        rows.append(
            part(
                (0.29 * k * side, 0.0, arm, arm, 0.78 * k),
                (0.27 * k * side, 0.0, 1.1 * arm, 1.1 * arm, 1.43 * k),
                0.8 * coat,
                of=Substance.CLOTH,
                swing=(0.8 * stride, gait, phase + offset, 0.03 * k),
            )
        )
    rows.append(
        part((0.0, 0.02, 0.125 * k, 0.0, 1.61 * k), albedo=0.42, shape=BLOB, of=Substance.SKIN)
    )
    rows.append(
        part((0.0, -0.02, 0.10 * k, 0.0, 1.68 * k), albedo=0.06, shape=BLOB, of=Substance.HAIR)
    )
    return part_rows(rows)


def cyclist(
    coat: float, trousers: float, frame: float, *, cadence: float, phase: float = 0.0, lit: bool
) -> NDArray[np.float64]:
    """A rider on a bicycle: two open wheels, a frame, pedalling legs and a leaning body."""
    rows = [_shadow(0.25, 0.85)]
    for forward in (-0.53, 0.53):
        ring = (0.0, forward, 0.36, 0.06, 0.36)
        rows.append(part(ring, albedo=0.02, shape=WHEEL, of=Substance.RUBBER))
        rows.append(part((0.0, forward, 0.035, 0.3, 0.02), (0.0, forward, 0.035, 0.02, 0.72), 0.02))
    rows += [
        part(
            (0.0, 0.0, 0.03, 0.06, 0.28),
            (0.0, 0.38, 0.03, 0.05, 0.85),
            frame,
            of=Substance.CAR_PAINT,
        ),
        part(
            (0.0, -0.05, 0.03, 0.05, 0.3),
            (0.0, -0.22, 0.03, 0.05, 0.95),
            frame,
            of=Substance.CAR_PAINT,
        ),
        part(
            (0.0, 0.52, 0.03, 0.04, 0.36),
            (0.0, 0.40, 0.03, 0.04, 1.0),
            frame,
            of=Substance.CAR_PAINT,
        ),
        part((0.0, 0.42, 0.29, 0.04, 0.98), (0.0, 0.42, 0.29, 0.04, 1.05), 0.05),
    ]
    for side, offset in ((1.0, 0.0), (-1.0, np.pi)):
        rows.append(
            part(
                (0.11 * side, 0.02, 0.07, 0.08, 0.2),
                (0.11 * side, -0.16, 0.10, 0.12, 0.98),
                trousers,
                of=Substance.DENIM,
                swing=(0.17, cadence, phase + offset, 0.2),
            )
        )
    rows.append(
        part(
            (0.0, -0.22, 0.17, 0.14, 0.92),
            (0.0, 0.2, 0.23, 0.14, 1.52),
            coat,
            pane=0.0,
            of=Substance.CLOTH,
        )
    )
    for side in (1.0, -1.0):
        rows.append(
            part(
                (0.27 * side, 0.44, 0.05, 0.05, 1.0),
                (0.23 * side, 0.2, 0.06, 0.06, 1.46),
                0.8 * coat,
                of=Substance.CLOTH,
            )
        )
    rows.append(part((0.0, 0.3, 0.125, 0.0, 1.68), albedo=0.42, shape=BLOB, of=Substance.SKIN))
    rows.append(
        part((0.0, 0.27, 0.125, 0.0, 1.75), albedo=0.7, shape=BLOB, of=Substance.WHITE_PAINT)
    )
    if lit:
        head = (0.0, 0.5, 0.05, 0.0, 0.85)
        tail = (0.0, -0.6, 0.05, 0.0, 0.7)
        rows.append(part(head, shape=BLOB, of=Substance.HEADLAMP, seen_from=FRONT, emit=20.0))
        rows.append(part(tail, shape=BLOB, of=Substance.TAIL_LAMP, seen_from=BACK, emit=4.0))
    return part_rows(rows)


def street_lamp(*, reach: float, lit: bool) -> NDArray[np.float64]:
    """A lamp post whose arm reaches `reach` metres to its right."""
    return part_rows(
        [
            part((0.0, 0.0, 0.08, 0.08, 0.0), (0.0, 0.0, 0.05, 0.05, 6.0), 0.12),
            part(
                (0.5 * reach, 0.0, 0.5 * abs(reach), 0.04, 5.9),
                (0.5 * reach, 0.0, 0.5 * abs(reach), 0.04, 6.0),
                0.12,
            ),
            part(
                (reach, 0.0, 0.3, 0.15, 5.8),
                (reach, 0.0, 0.3, 0.15, 5.95),
                0.5,
                emit=260.0 if lit else 0.0,
            ),
        ]
    )


def tree(leaves: float, *, height: float) -> NDArray[np.float64]:
    """A street tree: a trunk and a crown of overlapping blobs."""
    rows = [
        part(
            (0.0, 0.0, 0.14, 0.14, 0.0), (0.0, 0.0, 0.1, 0.1, 0.6 * height), 0.07, of=Substance.BARK
        )
    ]
    blobs = [(0.0, 0.0, 0.30, 0.72, 1.0), (0.6, 0.3, 0.2, 0.62, 0.6), (-0.7, -0.2, 0.2, 0.68, 1.5)]
    blobs += [(0.1, -0.1, 0.19, 0.88, 1.8), (-0.2, 0.4, 0.14, 0.57, 0.5)]
    for right, forward, radius, up, shade in blobs:
        disc = (right, forward, radius * height, 0.0, up * height)
        rows.append(part(disc, albedo=leaves * shade, shape=BLOB, of=Substance.FOLIAGE))
    return part_rows(rows)


def sign(face: float) -> NDArray[np.float64]:
    """A traffic sign on a post."""
    return part_rows(
        [
            part((0.0, 0.0, 0.035, 0.035, 0.0), (0.0, 0.0, 0.035, 0.035, 2.2), 0.3),
            part((0.0, 0.0, 0.32, 0.0, 2.4), albedo=0.08, shape=BLOB),
            part(
                (0.0, 0.0, 0.24, 0.0, 2.4),
                albedo=face,
                shape=BLOB,
                of=Substance.WHITE_PAINT,
                mode=ATOP,
            ),
        ]
    )


def bin_box(paint: float) -> NDArray[np.float64]:
    """A waste bin or a small cabinet, about as high as a child."""
    return part_rows(
        [
            _shadow(0.4, 0.4),
            part(
                (0.0, 0.0, 0.3, 0.3, 0.0),
                (0.0, 0.0, 0.33, 0.33, 1.05),
                paint,
                pane=0.0,
                of=Substance.CAR_PAINT,
            ),
        ]
    )
