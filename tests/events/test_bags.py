"""Bags that rosbags itself wrote: events by topic, by stamp, of either polarity, out of order."""

import numpy as np
import pytest
from event_files import packet, rows, write_bag
from ros_bags import ARRAYS, KINDS, event_array, image, in_packets, typestore, write

from eqs.commands.convert import main as convert
from eqs.events import Events, Hints
from eqs.events.formats import decode
from eqs.events.ordered import OrderedFile

EPOCH_US = 1_700_000_000_000_000


@pytest.fixture(scope="module")
def events():
    generator = np.random.default_rng(0)
    t = EPOCH_US + np.sort(generator.integers(0, 900_000, 5000))
    x, y, p = (generator.integers(0, high, 5000) for high in (640, 480, 2))
    return Events.from_arrays(t, x, y, p, height=480, width=640)


@pytest.mark.parametrize("package", ARRAYS)
@pytest.mark.parametrize("frame", ["", "cam", "camera_link"])
@pytest.mark.parametrize("kind", KINDS)
def test_events_come_as_they_were_written(tmp_path, events, kind, frame, package):
    # The second packet is empty, the fourth has one event.
    made = in_packets(events, [700, 700, 2000, 2001], package, frame=frame)
    path = write(tmp_path, kind, made)
    found = Events.load(path)
    np.testing.assert_array_equal(rows(found), rows(events))
    assert (found.height, found.width) == (480, 640)


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_without_any_event_is_empty(tmp_path, events, kind):
    path = write(tmp_path, kind, in_packets(events[:0], []))
    found = Events.load(path)
    assert (len(found), found.height, found.width) == (0, 480, 640)


def test_the_library_s_own_reading_agrees(events):
    # What the fast reader must give is what the library makes of the same bytes.
    store = typestore(ros1=False)
    message = event_array(store, events[:100])
    again = store.deserialize_cdr(
        store.serialize_cdr(message, message.__msgtype__), message.__msgtype__
    )
    table = [(e.ts.sec * 10**6 + e.ts.nanosec // 1000, e.x, e.y, e.polarity) for e in again.events]
    np.testing.assert_array_equal(np.array(table, np.int64), rows(events[:100]))


@pytest.mark.parametrize("kind", KINDS)
def test_a_topic_is_chosen_by_its_name_and_others_are_listed(tmp_path, events, kind, capsys):
    def messages(store):
        yield from in_packets(events, [2500], topic="/left/events")(store)
        yield from in_packets(events[:10], [], topic="/right/events")(store)
        yield "/camera", 5000, image(store, np.zeros((2, 2), np.uint8), "mono8", EPOCH_US)

    path = write(tmp_path, kind, messages)
    with pytest.raises(ValueError, match=r"one topic of events .*/right/events.* with --topic"):
        decode(path)
    assert len(decode(path, Hints(topics="/right/events")).t) == 10
    out = tmp_path / "left.h5"
    convert([str(path), str(out), "--topic", "/left/events"], "eqs convert")
    assert capsys.readouterr().out == f"{out}: 5,000 events of a bag of event arrays\n"
    with pytest.raises(SystemExit) as stop:
        convert([str(path), str(tmp_path / "b.h5"), "--topic", "/dvs/event"], "eqs convert")
    for said in (
        "Expected the topic /dvs/event in", "/left/events (dvs_msgs/msg/EventArray)",
        "/camera (sensor_msgs/msg/Image)",
    ):  # fmt: skip
        assert said in str(stop.value)


@pytest.mark.parametrize("kind", KINDS)
def test_the_stamp_of_the_header_counts_where_it_is_asked_for(tmp_path, events, kind):
    def messages(store):
        for index in range(4):
            part = events[10 * index : 10 * index + 10]
            yield "/dvs", index, event_array(store, part, EPOCH_US + 20_000 * index)

    path = write(tmp_path, kind, messages)
    found = decode(path, Hints(stamp="header"))
    assert found.t.tolist() == [EPOCH_US + 20_000 * k for k in range(4) for _ in range(10)]
    np.testing.assert_array_equal(found.x, events.x[:40])


def test_packets_have_times_of_their_own_alone(tmp_path):
    messages = [("/e", "event_camera_msgs/msg/EventPacket", 1, packet(b"evt3", b"", True))]
    path = write_bag(tmp_path / "a.bag", messages)
    with pytest.raises(ValueError, match=r"arrays of events in .*EventPacket\); set stamp=event"):
        decode(path, Hints(stamp="header"))


def test_polarity_is_turned_round_where_it_is_asked_for(tmp_path, events):
    path = write(tmp_path, "bag", in_packets(events, [9]))
    out = tmp_path / "out.h5"
    convert([str(path), str(out), "--invert-polarity"], "eqs convert")
    once = Events.load(out)
    np.testing.assert_array_equal(once.p, 1 - events.p)
    np.testing.assert_array_equal(once.x, events.x)
    # Of a file in the layout of DSEC too.
    twice = Events.concatenate(list(OrderedFile(out, Hints(invert_polarity=True))))
    np.testing.assert_array_equal(twice.p, events.p)


@pytest.mark.parametrize("kind", KINDS)
def test_packets_that_overtook_each_other_are_merged_and_another_run_is_not(tmp_path, events, kind):
    def swapped(late_us):
        def messages(store):
            first, second = events[:2000], events[2000:4000]
            shift = int(second.t[0] - first.t[0]) - late_us
            yield "/dvs", 1, event_array(store, second.shifted(-shift))
            yield "/dvs", 2, event_array(store, first)

        return messages

    (tmp_path / "late").mkdir()
    newest = int(events.t[3999]) - int(events.t[2000])  # of the packet that comes first
    path = write(tmp_path, kind, swapped(99_000 - newest))
    found = Events.concatenate(list(OrderedFile(path)))
    assert len(found) == 4000
    assert (np.diff(found.t) >= 0).all()
    path = write(tmp_path / "late", kind, swapped(101_000 - newest))
    with pytest.raises(ValueError, match=r"at most 100000 us late in .*; cut the bag where its"):
        Events.load(path)


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_that_was_cut_off_ends_in_a_sentence(tmp_path, events, kind):
    path = write(tmp_path, kind, in_packets(events, [2500]))
    (file,) = [path] if kind == "bag" else path.glob(f"*.{kind}")
    content = file.read_bytes()
    file.write_bytes(content[: len(content) // 2])
    with pytest.raises(ValueError, match=r"Expected (a )?whole"):
        Events.load(path)


def test_a_topic_of_several_publishers_is_one(tmp_path, events):
    from rosbags import rosbag1

    store, path = typestore(ros1=True), tmp_path / "a.bag"
    with rosbag1.Writer(path) as writer:
        for index, name in enumerate(("/one", "/two")):
            message = event_array(store, events[5 * index : 5 * index + 5])
            kind = message.__msgtype__
            known = writer.add_connection("/dvs", kind, typestore=store, callerid=name)
            writer.write(known, index, store.serialize_ros1(message, kind))
    np.testing.assert_array_equal(rows(Events.load(path)), rows(events[:10]))
