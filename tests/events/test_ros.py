"""Messages of bags, serialised here by the rules of ROS 1 and of CDR."""

from pathlib import Path

import numpy as np
import pytest

from eqs.events.formats import decode
from eqs.events.ros import arrays, packets

EVENTS = [(1_700_000_000_123_456, 5, 7, 1), (1_700_000_000_123_457, 600, 479, 0),
          (1_700_000_001_000_000, 0, 0, 1)]  # fmt: skip


class Writer:
    """Puts fields behind each other, aligned as CDR wants it, or not."""

    def __init__(self, ros1):
        self.ros1, self.content = ros1, bytearray() if ros1 else bytearray(b"\0\1\0\0")

    def number(self, value, size):
        if not self.ros1:
            self.content += bytes(-(len(self.content) - 4) % size)
        self.content += int(value).to_bytes(size, "little")

    def bytes(self, value, zero=False):
        value += b"\0" if zero and not self.ros1 else b""
        self.number(len(value), 4)
        self.content += value

    def header(self, frame):
        for _ in range(3 if self.ros1 else 2):
            self.number(1, 4)
        self.bytes(frame, zero=True)
        self.number(480, 4)
        self.number(640, 4)


def packet(encoding, events, ros1, base_ns=0, frame=b"camera"):
    writer = Writer(ros1)
    writer.header(frame)
    writer.number(1, 8)
    writer.number(base_ns, 8)
    writer.bytes(encoding, zero=True)
    writer.number(0, 1)
    writer.bytes(events)
    return bytes(writer.content)


def rows(found):
    events = found.events()
    return list(zip(*(getattr(events, name).tolist() for name in "txyp"), strict=True))


@pytest.mark.parametrize("ros1", [True, False])
@pytest.mark.parametrize("frame", [b"", b"cam", b"camera_"])
def test_arrays_of_events(ros1, frame):
    messages = []
    for part in (EVENTS[:2], [], EVENTS[2:]):
        writer = Writer(ros1)
        writer.header(frame)
        writer.number(len(part), 4)
        for t, x, y, p in part:
            for value, size in ((x, 2), (y, 2), (t // 10**6, 4), (t % 10**6 * 1000, 4), (p, 1)):
                writer.number(value, size)
        messages.append(bytes(writer.content))
    assert rows(arrays(iter(messages), Path("a"), ros1=ros1)) == EVENTS


@pytest.mark.parametrize("ros1", [True, False])
def test_mono_counts_from_the_packet_s_base(ros1):
    messages = []
    for t, x, y, p in EVENTS:
        word = np.array([p << 63 | y << 48 | x << 32 | 5_999], np.uint64).tobytes()
        messages.append(packet(b"mono", word, ros1, base_ns=(t - 5) * 1000))
    assert rows(packets(iter(messages), Path("a"), ros1=ros1)) == EVENTS


@pytest.mark.parametrize("ros1", [True, False])
def test_a_clock_of_31_bits_turns_between_packets(ros1):
    t = [2**31 - 3, 2**31 - 1, 4]
    messages = []
    for time, (_, x, y, p) in zip(t, EVENTS, strict=True):
        pair = np.array([x << 17 | y << 2 | p << 1 | 1, time], "<u4").tobytes()
        invalid = np.array([x << 17 | y << 2, time], "<u4").tobytes()
        messages.append(packet(b"libcaer", pair + invalid, ros1))
    found = packets(iter(messages), Path("a"), ros1=ros1)
    expected = [(time, *each[1:]) for time, each in zip([*t[:2], 2**31 + 4], EVENTS, strict=True)]
    assert rows(found) == expected


def test_words_of_evt3_go_on_from_packet_to_packet():
    first = np.array([8 << 12 | 1, 6 << 12 | 2, 7], "<u2").tobytes()
    second = np.array([2 << 12 | 1 << 11 | 5], "<u2").tobytes()
    messages = [packet(b"evt3", first, False), packet(b"evt3", second, False)]
    assert rows(packets(iter(messages), Path("a"), ros1=False)) == [(4098, 5, 7, 1)]


@pytest.mark.parametrize("ros1", [True, False])
def test_compressed_packets_begin_their_times_anew(ros1):
    """Words: 0 and 1 times, 2 column, 3 event, 4 base, 5 eight rows above it, which move it on."""
    first = [0 << 12 | 1, 1 << 12 | 5, 2 << 12 | 9, 3 << 12 | 1 << 11 | 4]
    first += [4 << 12 | 1 << 11 | 16, 5 << 12 | 0b101, 5 << 12 | 0b10]
    second = [3 << 12 | 7, 1 << 12 | 2, 3 << 12 | 8]
    messages = [
        packet(b"libcaer_cmp", np.array(words, "<u2").tobytes(), ros1) for words in (first, second)
    ]
    found = packets(iter(messages), Path("a"), ros1=ros1)
    base = found.t.min()
    assert {(t - base, x, y, p) for t, x, y, p in rows(found)} == {
        (4101, 9, 4, 1), (4101, 9, 16, 1), (4101, 9, 18, 1), (4101, 9, 25, 1),
        (0, 9, 7, 0), (2, 9, 8, 0),
    }  # fmt: skip


def test_encodings_that_are_not_read_are_named():
    message = packet(b"evt4", b"1234", False)
    with pytest.raises(ValueError, match=r"libcaer or libcaer_cmp in a, got evt4; convert"):
        packets(iter([message]), Path("a"), ros1=False)
    with pytest.raises(ValueError, match="got one that was cut off"):
        packets(iter([message[:20]]), Path("a"), ros1=False)


@pytest.mark.parametrize("start", [b"#ROSBAG V2.0\n", b"SQLite format 3\0", b"\x89MCAP0\r\n"])
def test_a_damaged_bag_ends_in_a_sentence(tmp_path, start):
    (tmp_path / "a.bag").write_bytes(start + bytes(40))
    with pytest.raises(ValueError, match="Expected"):
        decode(tmp_path / "a.bag")
