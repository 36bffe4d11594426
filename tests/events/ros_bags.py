"""Bags written message by message by rosbags itself, of both versions."""

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

KINDS = ("bag", "db3", "mcap")  # ROS 1, and the two ways in which ROS 2 stores
ARRAYS = ("dvs_msgs", "prophesee_event_msgs")


def typestore(ros1):
    """The types of a version of ROS, and those of event cameras."""
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    time = "time" if ros1 else "builtin_interfaces/Time"
    for package in ARRAYS:
        event = f"uint16 x\nuint16 y\n{time} ts\nbool polarity\n"
        array = f"std_msgs/Header header\nuint32 height\nuint32 width\n{package}/Event[] events\n"
        store.register(get_types_from_msg(event, f"{package}/msg/Event"))
        store.register(get_types_from_msg(array, f"{package}/msg/EventArray"))
    return store


def header(store, time_us, frame):
    stamp = store.types["builtin_interfaces/msg/Time"](*in_parts(time_us))
    counted = {"seq": 1} if "seq" in store.types["std_msgs/msg/Header"].__annotations__ else {}
    return store.types["std_msgs/msg/Header"](**counted, stamp=stamp, frame_id=frame)


def in_parts(time_us):
    """Seconds and nanoseconds, some of which are lost in microseconds."""
    return time_us // 1_000_000, time_us % 1_000_000 * 1000 + 7


def event_array(store, events, time_us=None, frame="camera", package="dvs_msgs"):
    """A message with all of these events, at the time of the first or another."""
    time, event = store.types["builtin_interfaces/msg/Time"], store.types[f"{package}/msg/Event"]
    rows = [
        event(x=x, y=y, ts=time(*in_parts(t)), polarity=bool(p))
        for t, x, y, p in zip(*(getattr(events, name).tolist() for name in "txyp"), strict=True)
    ]
    if time_us is None:
        time_us = int(events.t[0]) if len(events) else 0
    return store.types[f"{package}/msg/EventArray"](
        header(store, time_us, frame), events.height, events.width, rows
    )


def image(store, picture, encoding, time_us, frame="camera"):
    """A picture as it is, whatever its encoding calls its numbers."""
    rows = np.ascontiguousarray(picture).reshape(len(picture), -1).view(np.uint8)
    height, width = picture.shape[:2]
    return store.types["sensor_msgs/msg/Image"](
        header(store, time_us, frame), height, width, encoding, 0, rows.shape[1], rows.reshape(-1)
    )


def compressed(store, content, said, time_us):
    """A JPEG or a PNG."""
    return store.types["sensor_msgs/msg/CompressedImage"](
        header(store, time_us, "camera"), said, np.frombuffer(content, np.uint8)
    )


def write(folder, kind, messages):
    """A bag of (topic, nanoseconds, message), for ROS 2 a folder.

    Args:
        folder: where the bag goes.
        kind: one of KINDS.
        messages: makes them of a store of types.
    """
    ros1 = kind == "bag"
    store = typestore(ros1)
    if ros1:
        path = folder / "run.bag"
        opened = rosbag1.Writer(path)
    else:
        path = folder / f"run_{kind}"
        plugin = rosbag2.StoragePlugin.MCAP if kind == "mcap" else rosbag2.StoragePlugin.SQLITE3
        opened = rosbag2.Writer(path, version=9, storage_plugin=plugin)
    serialise = store.serialize_ros1 if ros1 else store.serialize_cdr
    with opened as writer:
        known = {}
        for topic, time_ns, message in messages(store):
            name = message.__msgtype__
            if topic not in known:
                known[topic] = writer.add_connection(topic, name, typestore=store)
            writer.write(known[topic], time_ns, serialise(message, name))
    return path


def in_packets(events, cuts, package="dvs_msgs", topic="/dvs/events", frame="camera"):
    """Makes the messages of a stream that is cut at these places."""

    def messages(store):
        for index, part in enumerate(np.split(np.arange(len(events)), cuts)):
            piece = events[slice(part[0], part[-1] + 1)] if len(part) else events[:0]
            yield topic, 1000 + index, event_array(store, piece, frame=frame, package=package)

    return messages
