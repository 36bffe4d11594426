"""Events in ROS 1 and ROS 2 bags and MCAP files.

Source: the message definitions of `event_camera_msgs`, `event_array_msgs` and `dvs_msgs`, and the
serialisation rules of ROS 1 and of CDR.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from eqs.events.bounded import BoundedPath
from eqs.events.decoded import Clock, Decoded
from eqs.events.words import Arrays, evt3, libcaer_cmp, untold
from eqs.extras import needed

PACKET = ("event_camera_msgs/msg/EventPacket", "event_array_msgs/msg/EventArray")
ARRAY = ("dvs_msgs/msg/EventArray", "prophesee_event_msgs/msg/EventArray")
IMAGE = ("sensor_msgs/msg/Image",)
ROS1 = b"#ROSBAG"
BAGS = (ROS1, b"SQLite format 3", b"\x89MCAP")  # what they begin with


class Message:
    """Reads one message's bytes field by field.

    Args:
        raw: the bytes.
        ros1: whether fields follow each other without gaps, as in ROS 1; CDR aligns them.
    """

    def __init__(self, raw: bytes, *, ros1: bool) -> None:
        """Begin at the first field."""
        self.raw, self.ros1 = raw, ros1
        self.start = self.at = 0 if ros1 else 4
        self.stamp_us = 0

    def number(self, size: int) -> int:
        """The next whole number of so many bytes.

        Raises:
            ValueError: the message ends before.
        """
        if not self.ros1:
            self.at = self.start + -(-(self.at - self.start) // size) * size
        value = self.raw[self.at : self.at + size]
        if len(value) < size:
            raise ValueError("Expected whole messages, got one that was cut off; record it again")
        self.at += size
        return int.from_bytes(value, "little")

    def text(self) -> str:
        """The next text."""
        return self.bytes().rstrip(b"\0").decode("latin-1")

    def bytes(self) -> bytes:
        """The next row of bytes."""
        count = self.number(4)
        self.at += count
        return bytes(self.raw[self.at - count : self.at])

    def header(self) -> tuple[int, int]:
        """Height and width, which follow the stamp and the frame's name; the stamp is kept."""
        if self.ros1:
            self.number(4)
        self.stamp_us = 1_000_000 * self.number(4) + self.number(4) // 1000
        self.text()
        return self.number(4), self.number(4)


class Bag:
    """A bag, open in the block: its topics, and the bytes of their messages.

    Args:
        path: the file.

    Raises:
        ValueError: the bag is damaged, or rosbags, the optional dependency `ros`, is not installed.
    """

    def __init__(self, path: Path) -> None:
        """Find out of which version it is."""
        self.path = path
        with path.open("rb") as file:
            self.ros1 = file.read(len(ROS1)) == ROS1

    def __enter__(self) -> Self:
        """Open the bag."""
        with needed("ros", f"to read {self.path}"):
            from rosbags.rosbag1 import Reader as Reader1
            from rosbags.rosbag2 import Reader as Reader2
        with self._whole():
            self._reader = (Reader1 if self.ros1 else Reader2)(BoundedPath(self.path))
            self._reader.open()
        return self

    def __exit__(self, *_: object) -> None:
        """Close the bag."""
        self._reader.close()

    def topics(self, kinds: Collection[str]) -> list[Any]:
        """The topics of these kinds of messages."""
        return [each for each in self._reader.connections if each.msgtype in kinds]

    def listed(self) -> str:
        """All topics and their kinds."""
        return ", ".join(f"{each.topic} ({each.msgtype})" for each in self._reader.connections)

    def messages(self, topic: Any) -> Iterator[bytes]:  # noqa: ANN401 - the library's own type
        """The bytes of a topic's messages."""
        with self._whole():
            found = self._reader.messages(connections=[topic])
        while True:
            with self._whole():
                message = next(found, None)
            if message is None:
                return
            yield bytes(message[2])

    @contextmanager
    def _whole(self) -> Iterator[None]:
        try:
            yield
        except Exception as error:  # the library raises whatever damage leads it to
            raise ValueError(f"Expected a whole bag at {self.path}, got: {error}") from error


def read_bag(path: Path) -> Iterator[Decoded]:
    """Events of the only topic with events in a bag.

    Raises:
        ValueError: there is none, or there are several, or their encoding is not read here, or the
            bag is damaged; or rosbags, the optional dependency `ros`, is not installed.
    """
    with Bag(path) as bag:
        found = bag.topics((*PACKET, *ARRAY))
        if len(found) != 1:
            raise ValueError(
                f"Expected one topic of events ({', '.join((*PACKET, *ARRAY))}) in {path}, "
                f"got {bag.listed() or 'none'}; write the one that is meant into a bag of its own"
            )
        messages = bag.messages(found[0])
        if found[0].msgtype in PACKET:
            yield from packets(messages, path, ros1=bag.ros1)
        else:
            yield from arrays(messages, ros1=bag.ros1)


def packets(messages: Iterator[bytes], path: Path, *, ros1: bool) -> Iterator[Decoded]:
    """Events of packets: a camera's own encoding, or `mono`.

    Convention: a packet of `mono` or `libcaer_cmp` states the time that its events count from; the
    others carry a clock of their own from packet to packet.

    Raises:
        ValueError: the packets are of another encoding.
    """
    decoders: dict[str, Callable[[bytes, int], Arrays]] = {
        "evt3": _evt3(), "libcaer": _libcaer(), "libcaer_cmp": _libcaer_cmp(), "mono": _mono,
    }  # fmt: skip
    for raw in messages:
        message = Message(raw, ros1=ros1)
        height, width = message.header()
        message.number(8)
        base_ns, encoding = message.number(8), message.text()
        message.number(1)
        if encoding not in decoders:
            raise ValueError(
                f"Expected packets of {', '.join(decoders)} in {path}, got {encoding or 'none'}; "
                "convert them with event_camera_tools"
            )
        t, x, y, p, dropped = decoders[encoding](message.bytes(), base_ns)
        yield Decoded(
            kind=f"a bag of event packets ({encoding})", t=t, x=x, y=y, p=p,
            height=height or None, width=width or None, dropped=dropped,
        )  # fmt: skip


def _whole(content: bytes, kind: str) -> NDArray[Any]:
    """The words of a packet, without one that was cut off."""
    return np.frombuffer(content, kind, len(content) // np.dtype(kind).itemsize)


def _evt3() -> Callable[[bytes, int], Arrays]:
    state = untold()
    return lambda content, _: evt3(_whole(content, "<u2"), state)


def _libcaer_cmp() -> Callable[[bytes, int], Arrays]:
    state = untold()

    def decode(content: bytes, base_ns: int) -> Arrays:
        t, x, y, p, dropped = libcaer_cmp(_whole(content, "<u2"), state)
        return t + base_ns // 1000, x, y, p, dropped

    return decode


def _libcaer() -> Callable[[bytes, int], Arrays]:
    clock = Clock(1 << 31)

    def decode(content: bytes, _: int) -> Arrays:
        pairs = _whole(content, "<u4")
        pairs = pairs[: len(pairs) // 2 * 2].reshape(-1, 2)
        pairs = pairs[pairs[:, 0] & 1 == 1]  # the others were marked as none
        data = pairs[:, 0]
        x, y = (data >> 17).astype(np.uint16), (data >> 2 & 0x7FFF).astype(np.uint16)
        return clock.counted(pairs[:, 1]), x, y, (data >> 1 & 1).astype(np.uint8), 0

    return decode


def _mono(content: bytes, base_ns: int) -> Arrays:
    pairs = _whole(content, "<u4")
    pairs = pairs[: len(pairs) // 2 * 2].reshape(-1, 2)
    place = pairs[:, 1]
    x, y = (place & 0x7FFF).astype(np.uint16), (place >> 16 & 0x7FFF).astype(np.uint16)
    t = (base_ns + pairs[:, 0].astype(np.int64)) // 1000
    return t, x, y, (place >> 31).astype(np.uint8), 0


def arrays(messages: Iterator[bytes], *, ros1: bool) -> Iterator[Decoded]:
    """Events of arrays, each with a time of its own."""
    for raw in messages:
        message = Message(raw, ros1=ros1)
        height, width = message.header()
        fields = _records(message, message.number(4), ros1=ros1)
        t = fields[:, 2] * 1_000_000 + fields[:, 3] // 1000
        yield Decoded(
            kind="a bag of event arrays", t=t, x=fields[:, 0], y=fields[:, 1], p=fields[:, 4],
            height=height or None, width=width or None,
        )  # fmt: skip


def _records(message: Message, count: int, *, ros1: bool) -> NDArray[np.int64]:
    """The fields x, y, seconds, nanoseconds and polarity of so many events.

    Convention: CDR aligns every number by itself, so the first event differs from the others: its
    seconds follow x and y at once, theirs come after two bytes more.
    """
    packed = np.dtype([("x", "<u2"), ("y", "<u2"), ("s", "<u4"), ("ns", "<u4"), ("p", "u1")])
    if ros1:
        whole = min(count, (len(message.raw) - message.at) // packed.itemsize)
        table = np.frombuffer(message.raw, packed, whole, message.at)
        return np.stack([table[name].astype(np.int64) for name in packed.names or ()], axis=1)
    rows = [[message.number(size) for size in (2, 2, 4, 4, 1)] for _ in range(min(count, 1))]
    spread = np.dtype(
        {"names": ["x", "y", "s", "ns", "p"], "formats": ["<u2", "<u2", "<u4", "<u4", "u1"],
         "offsets": [0, 2, 6, 10, 14], "itemsize": 16}
    )  # fmt: skip
    at = message.at + (message.at - message.start) % 2
    rest = max(0, min(count - 1, (len(message.raw) - at + 1) // spread.itemsize))
    body = message.raw[at : at + rest * spread.itemsize].ljust(rest * spread.itemsize, b"\0")
    table = np.frombuffer(body, spread, rest)
    others = np.stack([table[name].astype(np.int64) for name in spread.names or ()], axis=1)
    return np.concatenate([np.array(rows, np.int64).reshape(-1, 5), others])
