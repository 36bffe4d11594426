"""Messages of bags, serialised here by the rules of ROS 1 and of CDR."""

from pathlib import Path

import numpy as np
import pytest
from event_files import Serialised, packet

from eqs.events.decoded import joined
from eqs.events.formats import decode
from eqs.events.ros import arrays, packets

EVENTS = [(1_700_000_000_123_456, 5, 7, 1), (1_700_000_000_123_457, 600, 479, 0),
          (1_700_000_001_000_000, 0, 0, 1)]  # fmt: skip


def rows(found):
    events = joined(found, "none").events()
    return list(zip(*(getattr(events, name).tolist() for name in "txyp"), strict=True))


@pytest.mark.parametrize("ros1", [True, False])
@pytest.mark.parametrize("frame", [b"", b"cam", b"camera_"])
def test_arrays_of_events(ros1, frame):
    messages = []
    for part in (EVENTS[:2], [], EVENTS[2:]):
        writer = Serialised(ros1)
        writer.header(frame)
        writer.number(len(part), 4)
        for t, x, y, p in part:
            for value, size in ((x, 2), (y, 2), (t // 10**6, 4), (t % 10**6 * 1000, 4), (p, 1)):
                writer.number(value, size)
        messages.append(bytes(writer.content))
    assert rows(arrays(iter(messages), ros1=ros1)) == EVENTS


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


def test_encodings_that_are_not_read_are_named():
    message = packet(b"trigger", b"1234", False)
    with pytest.raises(ValueError, match=r"libcaer_cmp, mono in a, got trigger; convert"):
        list(packets(iter([message]), Path("a"), ros1=False))
    with pytest.raises(ValueError, match="got one that was cut off"):
        list(packets(iter([message[:20]]), Path("a"), ros1=False))


@pytest.mark.parametrize("ros1", [True, False])
def test_compressed_libcaer_counts_from_the_packet_s_base(ros1):
    high, low, column, row, first_row, eight = (kind << 12 for kind in range(6))
    words = [
        [column | 9, low | 5, row | 1 << 11 | 7, high | 1, low | 2, row | 8],
        # The column is that of the packet before; a mask moves its first row on.
        [first_row | 1 << 11 | 20, eight | 0b10000001, eight | 1, row | 3],
    ]
    messages = [
        packet(b"libcaer_cmp", np.array(part, "<u2").tobytes(), ros1, base_ns=base)
        for part, base in zip(words, (1_000_999, 9_000_000), strict=True)
    ]
    assert rows(packets(iter(messages), Path("a"), ros1=ros1)) == [
        (1005, 9, 7, 1), (1000 + 4098, 9, 8, 0),
        (9000, 9, 20, 1), (9000, 9, 27, 1), (9000, 9, 28, 1), (9000, 9, 3, 0),
    ]  # fmt: skip


def test_events_before_the_first_column_are_dropped():
    words = np.array([3 << 12 | 7, 2 << 12 | 1, 3 << 12 | 7], "<u2").tobytes()
    found = joined(packets(iter([packet(b"libcaer_cmp", words, False)]), Path("a"), ros1=False), "")
    assert (found.dropped, len(found.t)) == (1, 1)


@pytest.mark.parametrize("start", [b"#ROSBAG V2.0\n", b"SQLite format 3\0", b"\x89MCAP0\r\n"])
def test_a_damaged_bag_ends_in_a_sentence(tmp_path, start):
    (tmp_path / "a.bag").write_bytes(start + bytes(40))
    with pytest.raises(ValueError, match="Expected"):
        decode(tmp_path / "a.bag")
