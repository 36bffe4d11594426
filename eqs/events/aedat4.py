"""AEDAT 4 files of iniVation's recorder: a header, then packets that may be compressed.

Source: the published description of the format and its schemas. They are read here and not by a
library, since the one there is ends the interpreter at some damaged files.
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from eqs.events.decoded import Decoded
from eqs.extras import needed

VERSION = b"#!AER-DAT4.0\r\n"
STORED, LZ4 = (0,), (1, 2)  # kinds of compression; the others are Zstandard
EVENT = np.dtype(
    {"names": ["t", "x", "y", "p"], "formats": ["<i8", "<i2", "<i2", "u1"],
     "offsets": [0, 8, 10, 12], "itemsize": 16}
)  # fmt: skip
# Numbers of a frame by their place in its table: first to last, and the kinds of pixels.
TIME, EXPOSED, COVERED, FORMAT, COLUMNS, ROWS, PIXELS = 0, 3, 4, 5, 6, 7, 10
PICTURES = {0: (np.uint8, 1), 2: (np.uint16, 1), 16: (np.uint8, 3), 24: (np.uint8, 4)}


@dataclass(frozen=True)
class Stream:
    """What a file says of one of its streams.

    Args:
        number: what its packets are marked with.
        kind: EVTS for events, FRME for frames.
        height: rows of the sensor.
        width: columns of the sensor.
    """

    number: int
    kind: str
    height: int | None
    width: int | None


class Table:
    """A table in a flatbuffer, whose size stands before it.

    Args:
        content: the buffer, its size included.

    Raises:
        struct.error: a place in it is none.
    """

    def __init__(self, content: bytes) -> None:
        """Find the table."""
        self.content = content
        self.start = 4 + self._at("<I", 4)
        self.places = self.start - self._at("<i", self.start)
        self.count = (self._at("<H", self.places) - 4) // 2

    def _at(self, kind: str, place: int) -> int:
        if place < 0:
            raise struct.error("a place before the first")
        return int(struct.unpack_from(kind, self.content, place)[0])

    def _place(self, index: int) -> int:
        """Where a field is; 0 where it has its default."""
        told = self._at("<H", self.places + 4 + 2 * index) if index < self.count else 0
        return self.start + told if told else 0

    def number(self, index: int, kind: str, default: int = 0) -> int:
        """A number."""
        place = self._place(index)
        return self._at(kind, place) if place else default

    def row(self, index: int, size: int = 1) -> bytes:
        """The bytes of a row of elements of such a size."""
        place = self._place(index)
        if not place:
            return b""
        start = place + self._at("<I", place)
        stop = start + 4 + size * self._at("<I", start)
        if stop > len(self.content):
            raise struct.error("a row that is longer than its packet")
        return self.content[start + 4 : stop]


@dataclass
class Aedat4:
    """An AEDAT 4 file.

    Args:
        path: the file.

    Raises:
        ValueError: the file is damaged, or what decompresses it, the optional dependency `aedat4`,
            is not installed.
    """

    path: Path
    streams: list[Stream] = field(init=False)

    def __post_init__(self) -> None:
        """Read the header."""
        with self.path.open("rb") as file, self._whole():
            file.seek(len(VERSION))
            length = self.path.stat().st_size
            head = Table(_sized(file, length))
            self._start = file.tell()
            stop = head.number(1, "<q", -1)  # where an index of the packets follows
            self._stop = stop if 0 <= stop < length else length
            self.streams = _streams(head.row(2).rstrip(b"\0"))
            compression = head.number(0, "<i")
        self._decompress = self._compression(compression)

    def packets(self, kind: str) -> Iterator[Table]:
        """The packets of the first stream of a kind."""
        number = self.first(kind).number
        with self.path.open("rb") as file:
            file.seek(self._start)
            while file.tell() + 8 <= self._stop:
                with self._whole():
                    stream, size = struct.unpack("<ii", file.read(8))
                    stop = file.tell() + size
                    if size < 0 or stop > self._stop:
                        raise struct.error("a packet that was cut off")
                    table = None
                    if stream == number:
                        table = Table(self._decompress(file.read(size)))
                file.seek(stop)
                if table is not None:
                    yield table

    def first(self, kind: str) -> Stream:
        """The first stream of a kind.

        Raises:
            ValueError: there is none.
        """
        for stream in sorted(self.streams, key=lambda each: each.number):
            if stream.kind == kind:
                return stream
        held = ", ".join(stream.kind for stream in self.streams) or "none"
        raise ValueError(f"Expected a stream of {kind} in {self.path}, got {held}")

    def events(self, packet: Table) -> NDArray[Any]:
        """The events of a packet."""
        with self._whole():
            return np.frombuffer(packet.row(0, EVENT.itemsize), EVENT)

    def frame(self, packet: Table) -> tuple[int, int, NDArray[Any]]:
        """Start and end of a frame's exposure, and its picture, grey or RGB.

        Raises:
            ValueError: its pixels are of a kind that is not read here.
        """
        with self._whole():
            start, stop = (packet.number(index, "<q", -1) for index in (EXPOSED, COVERED))
            kind = packet.number(FORMAT, "<b")
            if kind not in PICTURES:
                raise struct.error(f"pixels of kind {kind}")
            depth, channels = PICTURES[kind]
            shape = packet.number(ROWS, "<h"), packet.number(COLUMNS, "<h"), channels
            pixels = np.frombuffer(packet.row(PIXELS), depth)
            if pixels.size != np.prod(shape):
                raise struct.error(f"{pixels.size} pixels for a shape of {shape}")
            picture = pixels.reshape(shape)
        if start < 0 or stop < 0:
            start = stop = packet.number(TIME, "<q")
        return start, stop, picture[..., 0] if channels == 1 else picture[..., 2::-1]

    def _compression(self, kind: int) -> Callable[[bytes], bytes]:
        if kind in STORED:
            return bytes
        new = sys.version_info >= (3, 14)  # since when the standard library has it
        module = "lz4.frame" if kind in LZ4 else "compression.zstd" if new else "backports.zstd"
        with needed("aedat4", f"to read {self.path}"):
            unpack: Callable[[bytes], bytes] = import_module(module).decompress
        return unpack

    @contextmanager
    def _whole(self) -> Iterator[None]:
        """Say that the file is damaged, in place of what went wrong in the block."""
        try:
            yield
        except Exception as error:  # of bytes that are not what they should be
            raise ValueError(
                f"Expected a whole AEDAT 4 file at {self.path}, got: {error}; record it again"
            ) from error


def read_aedat4(path: Path) -> Iterator[Decoded]:
    """Events of the first event stream of an AEDAT 4 file, packet by packet.

    Raises:
        ValueError: the file holds none or is damaged, or what decompresses it, the optional
            dependency `aedat4`, is not installed.
    """
    file = Aedat4(path)
    stream = file.first("EVTS")
    for packet in file.packets("EVTS"):
        events = file.events(packet)
        yield Decoded(
            kind="an AEDAT 4 file", t=events["t"], x=events["x"], y=events["y"], p=events["p"],
            height=stream.height, width=stream.width,
        )  # fmt: skip


def _sized(file: BinaryIO, most: int) -> bytes:
    """A buffer whose size stands before it."""
    head = file.read(4)
    (size,) = struct.unpack("<I", head)
    return head + file.read(min(size, most))


def _streams(xml: bytes) -> list[Stream]:
    """The streams that the header describes."""
    streams = []
    for node in ElementTree.fromstring(xml).iterfind("./node[@name='outInfo']/node"):
        kind = node.find("attr[@key='typeIdentifier']")
        sides = [node.find(f"node[@name='info']/attr[@key='{key}']") for key in ("sizeY", "sizeX")]
        texts = [side.text or "" if side is not None else "" for side in sides]
        height, width = (int(text) if text.isdecimal() else None for text in texts)
        name = node.get("name", "")
        if kind is not None and name.isdecimal():
            streams.append(Stream(int(name), kind.text or "", height, width))
    return streams
