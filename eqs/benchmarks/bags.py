"""Time the reading of event arrays out of bags against the deserialiser of rosbags itself."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from eqs.benchmarks.timing import time_runs
from eqs.events.decoded import joined
from eqs.events.formats import decode
from eqs.events.ros import ALIGNED, ARRAY, RECORD, arrays
from eqs.extras import needed

HEIGHT, WIDTH = 480, 640
PER_MESSAGE, BETWEEN_US = 30_000, 33_333  # a million events a second in messages of 30 Hz
COMPARED = 60_000  # events for the library, which takes seconds for them
EVENT = "uint16 x\nuint16 y\n{time} ts\nbool polarity\n"
EVENTS = "std_msgs/Header header\nuint32 height\nuint32 width\ndvs_msgs/Event[] events\n"
VERSIONS = {"ROS 1": True, "ROS 2": False}


def message(index: int, *, ros1: bool) -> bytes:
    """One message of random events, serialised by hand."""
    generator = np.random.default_rng(index)
    start = index * BETWEEN_US
    t = start + np.sort(generator.integers(0, BETWEEN_US, PER_MESSAGE))
    table = np.zeros(PER_MESSAGE, RECORD)
    table["x"] = generator.integers(0, WIDTH, PER_MESSAGE)
    table["y"] = generator.integers(0, HEIGHT, PER_MESSAGE)
    table["s"], table["ns"] = t // 1_000_000, t % 1_000_000 * 1000
    table["p"] = generator.integers(0, 2, PER_MESSAGE)
    stamp = np.array([start // 1_000_000, start % 1_000_000 * 1000], "<u4").tobytes()
    size = np.array([HEIGHT, WIDTH, PER_MESSAGE], "<u4").tobytes()
    if ros1:
        frame = np.array([6], "<u4").tobytes() + b"camera"
        return bytes(4) + stamp + frame + size + table.tobytes()
    frame = np.array([7], "<u4").tobytes() + b"camera\0\0"  # the last byte is the gap before size
    others = np.zeros(PER_MESSAGE - 1, ALIGNED)
    for name in RECORD.fields or ():
        others[name] = table[name][1:]
    return b"\0\1\0\0" + stamp + frame + size + table[:1].tobytes() + others.tobytes()


def typestore(*, ros1: bool) -> Any:  # noqa: ANN401 - the library's own type
    """The types of a version of ROS, with those of event arrays."""
    with needed("ros", "to time bags"):
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    event = EVENT.format(time="time" if ros1 else "builtin_interfaces/Time")
    store.register(get_types_from_msg(event, "dvs_msgs/msg/Event"))
    store.register(get_types_from_msg(EVENTS, ARRAY[0]))
    return store


def write_bag(path: Path, messages: Iterator[bytes], *, ros1: bool) -> None:
    """Write a bag with one topic of event arrays."""
    with needed("ros", "to time bags"):
        from rosbags import rosbag1, rosbag2
    with rosbag1.Writer(path) if ros1 else rosbag2.Writer(path, version=9) as writer:
        topic = writer.add_connection("/dvs/events", ARRAY[0], typestore=typestore(ros1=ros1))
        for index, content in enumerate(messages):
            writer.write(topic, index * BETWEEN_US * 1000, content)


def print_table(events: int) -> None:
    """Print how many events a second are read, here and by the library's deserialiser."""
    table = Table(title="Event arrays in bags", title_justify="left")
    for name in ("reading", *VERSIONS):
        table.add_column(name, justify="left" if name == "reading" else "right")
    found = [rates(max(events // PER_MESSAGE, 1), ros1=ros1) for ros1 in VERSIONS.values()]
    for name in found[0]:
        table.add_row(name, *(f"{each[name] / 1e6:.2f}" for each in found))
    Console(width=100).print(table)
    Console(width=100).print("million events a second, the fastest of three runs or more")


def rates(messages: int, *, ros1: bool) -> dict[str, float]:
    """Events a second of each way to read."""
    contents = [message(index, ros1=ros1) for index in range(messages)]
    store = typestore(ros1=ros1)
    deserialise = store.deserialize_ros1 if ros1 else store.deserialize_cdr
    few = contents[: max(COMPARED // PER_MESSAGE, 1)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / ("run.bag" if ros1 else "run")
        write_bag(path, iter(contents), ros1=ros1)
        counted = PER_MESSAGE * len(contents)
        ours = time_runs(lambda: joined(arrays(iter(contents), ros1=ros1), ""))
        whole = time_runs(lambda: decode(path))
    theirs = time_runs(lambda: [deserialise(content, ARRAY[0]) for content in few])
    return {
        "messages to columns": counted / ours.seconds,
        "a bag to one stream": counted / whole.seconds,
        "messages to objects, by rosbags": PER_MESSAGE * len(few) / theirs.seconds,
    }
