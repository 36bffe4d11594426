"""Any event file as a stream in the order of time, without holding all of it."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from eqs.events.decoded import Decoded, joined
from eqs.events.formats import PIECE_BYTES, is_dsec, pieces
from eqs.events.hints import NOTHING_SAID, Hints
from eqs.events.reader import EventReader
from eqs.events.stream import Events

HELD = 1 << 22  # events that wait for those that come late, some 60 MB
PIECE_EVENTS = 1 << 20


class OrderedFile:
    r"""A file of any kind, read once, piece by piece, in the order of time.

    The stream is that of the whole file, sorted stably. What the file turned out to be is known
    when it has been read.

    Args:
        path: the file.
        hints: what the file leaves open.
        held: how many places late an event may come; None holds back the whole file.
        size: about how many bytes of the file make a piece.

    Raises:
        FileNotFoundError: there is no such file (while reading).
        ValueError: the file is of no known kind, damaged, fits several readings, has an event
            outside of the sensor, or one that comes later than is allowed for (while reading).

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = Path(folder) / "events.txt"
        ...     _ = path.write_text("0.5 1 0 1\n0.7 2 0 1\n0.6 3 0 0\n")
        ...     file = OrderedFile(path, Hints(height=4, width=4, order="txyp"))
        ...     [part.x.tolist() for part in file], file.disorder
        ([[1, 3, 2]], 1)
    """

    def __init__(
        self,
        path: Path | str,
        hints: Hints = NOTHING_SAID,
        held: int | None = HELD,
        size: int = PIECE_BYTES,
    ) -> None:
        """Remember the file; nothing is opened yet."""
        self.path, self.hints, self.held, self.size = Path(path), hints, held, size
        self.fallback: tuple[int, int] | None = None
        """Height and width of the sensor where neither the file nor a hint says them."""
        self.kind = ""
        self.disorder = self.dropped = 0
        self.span_us: tuple[int, int] | None = None

    def __iter__(self) -> Iterator[Events]:
        """The stream, at least one piece of it."""
        self.disorder = self.dropped = 0
        return self._of_dsec() if is_dsec(self.path) else self._of_others()

    def _of_dsec(self) -> Iterator[Events]:
        self.kind = "HDF5 in the layout of DSEC"
        with EventReader(self.path, self.hints.height, self.hints.width) as reader:
            self.span_us = reader.span_us
            cuts = reader.cuts_us(PIECE_EVENTS)
            for start, stop in pairwise(cuts):
                piece = reader.window(start, stop)
                yield replace(piece, p=1 - piece.p) if self.hints.invert_polarity else piece

    def _of_others(self) -> Iterator[Events]:
        for part in in_order(self._counted(), self.held, self.path):
            for start in range(0, max(len(part.t), 1), PIECE_EVENTS):
                piece = part[start : start + PIECE_EVENTS]
                yield piece.events(*self._size(piece))

    def _size(self, piece: Decoded) -> tuple[int | None, int | None]:
        """Height and width as far as they are told."""
        height, width = self.hints.height, self.hints.width
        if self.fallback is not None and (piece.height or height) is None:
            height = self.fallback[0]
        if self.fallback is not None and (piece.width or width) is None:
            width = self.fallback[1]
        return height, width

    def _counted(self) -> Iterator[Decoded]:
        """The file's pieces, while their faults are counted."""
        newest: int | None = None
        most = None if self.held is None else PIECE_EVENTS
        for piece in gathered(pieces(self.path, self.hints, self.size), most):
            self.kind, self.dropped = piece.kind, self.dropped + piece.dropped
            self.disorder += piece.late(newest)
            if len(piece.t):
                last = int(piece.t.max())
                newest = last if newest is None else max(last, newest)
            yield piece


def gathered(parts: Iterable[Decoded], events: int | None) -> Iterator[Decoded]:
    """Pieces joined until there are so many events in one; all of them if None."""
    waiting: list[Decoded] = []
    for part in parts:
        waiting.append(part)
        if events is not None and sum(len(each.t) for each in waiting) >= events:
            yield joined(waiting, "")
            waiting = []
    if waiting:
        yield joined(waiting, "")


def in_order(parts: Iterable[Decoded], held: int | None, path: Path) -> Iterator[Decoded]:
    """Pieces of a file by time, equal times in the file's order; an empty one where none is.

    Args:
        parts: the pieces as the file has them.
        held: how many of the latest events wait for those that come late; all of them if None.
        path: the file, for the sentence.

    Raises:
        ValueError: an event comes later than that.
    """
    waiting: deque[Decoded] = deque()
    empty = joined([], f"{path}, which holds no event")
    newest: int | None = None
    given: int | None = None
    count = 0
    for part in parts:
        if not len(part.t):
            empty = part
            continue
        if part.late(newest):
            if given is not None and (earliest := int(part.t.min())) < given:
                raise ValueError(
                    f"Expected events that come at most {held} places late in {path}, got one at "
                    f"{earliest} us after one at {newest} us; add --whole, which holds all of the "
                    "file in memory"
                )
            waiting = deque([joined([*waiting, part], "").sorted()])
        else:
            waiting.append(part)
        newest, count = int(waiting[-1].t[-1]), count + len(part.t)
        while held is not None and count > held:
            ready, rest = waiting[0][: count - held], waiting.popleft()[count - held :]
            given, count = int(ready.t[-1]), count - len(ready.t)
            if len(rest.t):
                waiting.appendleft(rest)
            yield ready
    yield from waiting or [empty]
