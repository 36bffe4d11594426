"""Events in ROS 1 and ROS 2 bags and MCAP files.

Source: the message definitions of `event_camera_msgs`, `event_array_msgs`, `dvs_msgs` and
`prophesee_event_msgs`, and the serialisation rules of ROS 1 and of CDR.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eqs.clock import backwards
from eqs.events.bag import Bag, Message, one_topic
from eqs.events.decoded import Clock, Decoded
from eqs.events.hints import NOTHING_SAID, Hints
from eqs.events.words import Arrays, evt3, libcaer_cmp, untold

PACKET = ("event_camera_msgs/msg/EventPacket", "event_array_msgs/msg/EventArray")
ARRAY = ("dvs_msgs/msg/EventArray", "prophesee_event_msgs/msg/EventArray")
LATEST_US = 100_000  # how late an event may come; what is later is another run, or a broken clock
OTHERWISE = "cut the bag where its clock was set back, or set stamp=header if event times are wrong"
RECORD = np.dtype([("x", "<u2"), ("y", "<u2"), ("s", "<u4"), ("ns", "<u4"), ("p", "u1")])
# What CDR makes of every record but the first: two bytes more before the seconds, one before all.
ALIGNED = np.dtype(
    {"names": ["x", "y", "s", "ns", "p"], "formats": ["<u2", "<u2", "<u4", "<u4", "u1"],
     "offsets": [1, 3, 7, 11, 15], "itemsize": 16}
)  # fmt: skip


def read_bag(path: Path, hints: Hints = NOTHING_SAID) -> Iterator[Decoded]:
    """Events of the only topic with events in a bag, or of the one that is named.

    Raises:
        ValueError: there is none, or there are several, or their encoding is not read here, or an
            event comes too late to be of the same run, or the bag is damaged; or rosbags, the
            optional dependency `ros`, is not installed.
    """
    with Bag(path) as bag:
        topic = one_topic(bag, (*PACKET, *ARRAY), "events", hints.topics)
        if topic is None:
            raise ValueError(
                f"Expected a topic of events ({', '.join((*PACKET, *ARRAY))}) in {path}, got "
                f"{', '.join(hints.topics) or bag.listed()}; name one with --topic, or a topic of "
                "frames to get those"
            )
        messages = bag.messages(topic)
        if bag.kinds[topic] in ARRAY:
            found = arrays(messages, ros1=bag.ros1, stamp=hints.stamp)
        elif hints.stamp == "event":
            found = packets(messages, path, ros1=bag.ros1)
        else:
            raise ValueError(
                f"Expected arrays of events in {path}, whose messages have a stamp for all of "
                f"them, got {topic} ({bag.kinds[topic]}); set stamp=event"
            )
        yield from on_time(found, path)


def on_time(parts: Iterable[Decoded], path: Path) -> Iterator[Decoded]:
    """The parts of one run of a recorder, whose events come at most a tenth of a second late.

    Raises:
        ValueError: one comes later than that.
    """
    newest: int | None = None
    for part in parts:
        if part.late(newest):
            latest = np.maximum.accumulate(part.t)
            latest = latest if newest is None else np.maximum(latest, newest)
            worst = int(np.argmax(latest - part.t))
            before, time = int(latest[worst]), int(part.t[worst])
            if before - time > LATEST_US:
                advice = backwards(before, time, OTHERWISE)
                raise ValueError(
                    f"Expected events that come at most {LATEST_US} us late in {path}, got one at "
                    f"{time} us after one at {before} us; {advice}"
                )
        if len(part.t):
            last = int(part.t.max())
            newest = last if newest is None else max(last, newest)
        yield part


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
        height, width = message.sized_header()
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


def arrays(messages: Iterator[bytes], *, ros1: bool, stamp: str = "event") -> Iterator[Decoded]:
    """Events of arrays, each with a time of its own.

    Args:
        messages: the bytes of each array.
        ros1: whether they are serialised as in ROS 1.
        stamp: `header` where all events of an array have the time of its header.
    """
    for raw in messages:
        message = Message(raw, ros1=ros1)
        height, width = message.sized_header()
        x, y, s, ns, p = _records(message, message.number(4), ros1=ros1)
        if stamp == "header":
            t = np.full(len(x), message.stamp_us, np.int64)
        else:
            t = s.astype(np.int64) * 1_000_000 + ns // 1000
        yield Decoded(
            kind="a bag of event arrays", t=t, x=x, y=y, p=p,
            height=height or None, width=width or None,
        )  # fmt: skip


def _records(message: Message, count: int, *, ros1: bool) -> list[NDArray[Any]]:
    """The fields x, y, seconds, nanoseconds and polarity of so many events.

    Convention: CDR aligns every number by itself, so the first event differs from the others: its
    seconds follow x and y at once, theirs come after two bytes more.
    """
    if ros1:
        table = _table(message, RECORD, count)
        return [table[name] for name in RECORD.fields or ()]
    first = _table(message, RECORD, min(count, 1))
    message.at += RECORD.itemsize
    others = _table(message, ALIGNED, max(count - 1, 0))
    return [np.concatenate([first[name], others[name]]) for name in RECORD.fields or ()]


def _table(message: Message, kind: np.dtype[Any], count: int) -> NDArray[Any]:
    """So many records from here on, or those that are there of a message that was cut off."""
    whole = min(count, max(0, len(message.raw) - message.at) // kind.itemsize)
    return np.frombuffer(message.raw, kind, whole, message.at if whole else 0)
