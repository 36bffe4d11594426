"""What is timed is what is read: both readers give the same of the same bytes."""

import numpy as np
import pytest

from eqs.benchmarks.bags import PER_MESSAGE, VERSIONS, message, typestore, write_bag
from eqs.commands.benchmark import main as benchmark
from eqs.events.formats import decode
from eqs.events.ros import ARRAY


@pytest.mark.parametrize("ros1", VERSIONS.values())
def test_both_readers_give_the_same(tmp_path, ros1):
    content = message(3, ros1=ros1)
    store = typestore(ros1=ros1)
    theirs = (store.deserialize_ros1 if ros1 else store.deserialize_cdr)(content, ARRAY[0])
    path = tmp_path / ("a.bag" if ros1 else "a")
    write_bag(path, iter([content]), ros1=ros1)
    ours = decode(path)
    expected = [
        (e.ts.sec * 10**6 + e.ts.nanosec // 1000, e.x, e.y, e.polarity) for e in theirs.events
    ]
    assert len(expected) == PER_MESSAGE
    found = np.stack([ours.t, ours.x, ours.y, ours.p], axis=1)
    np.testing.assert_array_equal(found, np.array(expected, np.int64))


def test_the_table_names_both_versions(capsys, monkeypatch):
    monkeypatch.setattr("eqs.benchmarks.timing.time_runs.__defaults__", (0.0, 1))
    benchmark(["bags", "--events", "6e4"], "eqs benchmark")
    said = capsys.readouterr().out
    for word in ("ROS 1", "ROS 2", "messages to columns", "by rosbags"):
        assert word in said
