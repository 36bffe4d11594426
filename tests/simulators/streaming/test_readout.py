"""Readout arbiters against closed forms, slow oracles, and what each promises of any stream."""

import json
import pickle
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest

from eqs.events import Events
from eqs.simulators import ESIM, ICNS, Bottleneck, RowReadout, SynchronousReadout
from eqs.simulators.streaming.keys import event_key, events_of, ordered
from eqs.simulators.streaming.readout import LAST_US, WaitingEvents

SLOW = [
    Bottleneck(service_us=70.3),
    RowReadout(service_us=900),
    SynchronousReadout(period_us=1100),
]
FAST = [
    Bottleneck(service_us=0.3),
    RowReadout(service_us=0.7),
    SynchronousReadout(period_us=0.9),
]


def leave(readout, arisen, size=(4, 4)):
    """Stamps (t, y, x, p) at which events (t, y, x, p) in the stream's order leave."""
    keys = [event_key(t, y * size[1] + x, p) for t, y, x, p in arisen]
    return table(WaitingEvents(readout, size).flush(np.array(keys, np.int64)), size)


def table(keys, size):
    events = events_of([keys], *size, origin_us=0)
    fields = (events.t, events.y, events.x, events.p)
    return list(zip(*(field.tolist() for field in fields), strict=True))


def times(rows):
    return [row[0] for row in rows]


def in_row(stamps, y=0):
    """Events at these times that differ in nothing but their column."""
    return [(t, y, x, 1) for x, t in enumerate(stamps)]


def random_stream(seed, size, count, span_us):
    generator = np.random.default_rng(seed)
    pixels = generator.integers(0, size[0] * size[1], count)
    signs = generator.integers(0, 2, count)
    # Half of the events come in a burst.
    stamps = np.sort(generator.integers(0, span_us, count))
    stamps[count // 4 : 3 * count // 4] = stamps[count // 4]
    return ordered(np.array(list(map(event_key, stamps, pixels, signs)), np.int64), 0)


def test_a_bottleneck_keeps_its_distance():
    arisen = in_row([0, 3, 4, 50, 50, 85])
    found = leave(Bottleneck(service_us=10), arisen, (1, 6))
    assert times(found) == [0, 10, 20, 50, 60, 85]
    assert [row[2] for row in found] == [0, 1, 2, 3, 4, 5]


def test_a_bottleneck_below_a_microsecond_is_exact():
    found = times(leave(Bottleneck(service_us=0.015), in_row([7] * 1000), (1, 1000)))
    assert found == [7 + k * 15 // 1000 for k in range(1000)]
    ends = times(leave(Bottleneck(service_us=0.1), in_row([0] * 60_000), (1, 60_000)))
    assert np.array_equal(ends, np.arange(60_000) // 10)


def test_what_leaves_in_one_microsecond_is_in_the_streams_order():
    arisen = [(0, 3, 0, 1), (0, 3, 1, 1), (1, 0, 0, 0)]
    found = leave(Bottleneck(service_us=1.2), arisen)
    assert found == [(0, 3, 0, 1), (1, 3, 1, 1), (2, 0, 0, 0)]
    found = leave(Bottleneck(service_us=0.6), [(0, 3, 0, 1), (0, 3, 1, 1), (0, 3, 2, 1), *arisen])
    assert times(found) == sorted(times(found))
    assert found[2:4] == [(1, 3, 0, 1), (1, 3, 2, 1)]  # left the other way round


def test_rows_leave_together_and_in_turn():
    readout = RowReadout(service_us=10)
    arisen = [(0, 1, 0, 1), (0, 1, 3, 0), (0, 3, 0, 1), (2, 0, 0, 1), (2, 1, 1, 1), (11, 3, 1, 1)]
    assert leave(readout, arisen) == [
        (0, 1, 0, 1),  # the first row with events is served at once
        (0, 1, 3, 0),
        (10, 3, 0, 1),  # the next one below, before those above although they came earlier
        (20, 0, 0, 1),
        (30, 1, 1, 1),
        (40, 3, 1, 1),
    ]
    assert times(leave(readout, [(5, 2, 0, 1), (9, 2, 1, 1), (100, 2, 2, 1)])) == [5, 15, 100]


def test_a_clock_visits_each_row_once_per_scan():
    readout = SynchronousReadout(period_us=10)
    for row, arises, leaves in [
        *[(0, 0, 0), (0, 1, 30), (0, 30, 30), (0, 31, 60)],
        *[(1, 0, 10), (1, 10, 10), (1, 11, 40), (2, 0, 20), (2, 21, 50)],
    ]:
        assert leave(readout, [(arises, row, 0, 1)], (3, 1)) == [(leaves, row, 0, 1)]
    fine = SynchronousReadout(period_us=0.4)  # rows are visited at 0, 0.4, 0.8, 1.2, ...
    assert times(leave(fine, [(1, 0, 0, 1), (1, 2, 0, 1)], (3, 1))) == [1, 2]


def bottleneck_oracle(arisen, service, _):
    """One event after the other, with fractions of a microsecond."""
    free, left = Fraction(0), []
    for t, *rest in arisen:
        now = max(Fraction(t), free)
        left.append((int(now), *rest))
        free = now + service
    return left


def row_oracle(arisen, service, height):
    """Look through the whole list for each row that is served."""
    pending, left, free, last = list(arisen), [], Fraction(0), -1
    while pending:
        now = max(free, Fraction(min(times(pending))))
        turns = {(y - last - 1) % height: y for t, y, _, _ in pending if t <= now}
        last = turns[min(turns)]
        served = [event for event in pending if event[1] == last and event[0] <= now]
        left += [(int(now), *event[1:]) for event in served]
        pending = [event for event in pending if not (event[1] == last and event[0] <= now)]
        free = now + service
    return left


def clock_oracle(arisen, period, height):
    """Walk from tick to tick."""
    left = []
    for t, y, x, p in arisen:
        tick = int(t / period)
        while tick * period < t or tick % height != y:
            tick += 1
        left.append((int(tick * period), y, x, p))
    return left


@pytest.mark.parametrize(
    ("kind", "parameter", "oracle"),
    [
        (Bottleneck, "service_us", bottleneck_oracle),
        (RowReadout, "service_us", row_oracle),
        (SynchronousReadout, "period_us", clock_oracle),
    ],
    ids=["bottleneck", "row", "synchronous"],
)
@pytest.mark.parametrize("time", ["0.02", "0.7", "1", "3.3", "12"])
def test_random_streams_agree_with_a_slow_oracle(kind, parameter, oracle, time):
    size = (7, 5)
    keys = random_stream(int(float(time) * 100), size, 200, 400)
    expected = oracle(table(keys, size), Fraction(time), size[0])
    expected.sort(key=lambda event: event[:3])  # stable: a pixel's own keep their order
    found = WaitingEvents(kind(**{parameter: float(time)}), size).flush(keys)
    assert table(found, size) == expected


@pytest.mark.parametrize("readout", SLOW + FAST, ids=str)
def test_events_come_as_soon_as_they_are_final_whatever_the_cuts(readout):
    size = (7, 5)
    keys = random_stream(3, size, 400, 2000)
    whole = WaitingEvents(readout, size).flush(keys)
    for step_us in (1, 90, 1000):
        waiting, parts = WaitingEvents(readout, size), []
        marks = range(0, 2000 + step_us, step_us)
        for start_us, stop_us in pairwise(marks):
            first, last = np.searchsorted(keys, [event_key(us, 0, 0) for us in (start_us, stop_us)])
            parts.append(waiting.push(keys[first:last], stop_us))
            assert sum(map(len, parts)) == np.searchsorted(whole, event_key(stop_us, 0, 0))
        parts.append(waiting.flush(keys[:0]))
        np.testing.assert_array_equal(np.concatenate(parts), whole)


@pytest.mark.parametrize("kind", [Bottleneck, RowReadout])
def test_events_that_lie_apart_pass_unchanged(kind):
    keys = random_stream(0, (8, 8), 500, 10**6)
    keys = keys[np.diff(keys, prepend=-event_key(20, 0, 0)) >= event_key(20, 0, 0)]
    assert len(keys) > 100
    np.testing.assert_array_equal(WaitingEvents(kind(service_us=10), (8, 8)).flush(keys), keys)


@pytest.mark.parametrize("readout", SLOW, ids=str)
@pytest.mark.parametrize("kind", [ESIM, ICNS])
def test_nothing_is_lost_or_leaves_before_it_arose(kind, readout, walk):
    arisen, left = kind().simulate(*walk), kind(readout=readout).simulate(*walk)
    assert len(left) == len(arisen) > 1000
    assert (np.diff((left.t * 16 + left.y) * 16 + left.x) >= 0).all()
    # A pixel's own events keep their order.
    first, second = (np.argsort(e.y * 16 + e.x, kind="stable") for e in (arisen, left))
    for name in ("x", "y", "p"):
        np.testing.assert_array_equal(getattr(arisen, name)[first], getattr(left, name)[second])
    assert (left.t[second] >= arisen.t[first]).all()
    assert (left.t[second] > arisen.t[first]).any()


def assert_same(first, second):
    for name in "txyp":
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name), err_msg=name)


@pytest.mark.parametrize("readout", SLOW, ids=str)
@pytest.mark.parametrize("kind", [ESIM, ICNS])
def test_single_frames_and_a_saved_stream_give_the_same_events(kind, readout, walk):
    frames, stamps = walk
    simulator = kind(readout=readout)
    whole = simulator.simulate(frames, stamps)
    stream, parts = simulator.start(), []
    for index in range(len(frames)):
        parts.append(stream.step(frames[index : index + 1], stamps[index : index + 1]))
        stream = pickle.loads(pickle.dumps(stream))
    assert_same(Events.concatenate([*parts, stream.finish()]), whole)
    later = simulator.simulate(frames, stamps + 50_000_000_000)
    assert_same(later, whole.shifted(50_000_000_000))


def test_only_a_used_readout_is_among_the_parameters():
    assert "readout" not in ESIM().parameters()
    parameters = ESIM(readout=RowReadout(service_us=0.5)).parameters()
    assert parameters["readout"] == {"kind": "row", "service_us": 0.5}
    assert json.loads(json.dumps(parameters)) == parameters
    assert len({readout.parameters()["kind"] for readout in SLOW}) == 3


@pytest.mark.parametrize("time", [0, -1, 1e-7, 2e6, float("nan"), float("inf"), "1", None])
@pytest.mark.parametrize(
    ("kind", "name"),
    [(Bottleneck, "service_us"), (RowReadout, "service_us"), (SynchronousReadout, "period_us")],
)
def test_a_bad_time_is_refused_with_its_name(kind, name, time):
    with pytest.raises(ValueError, match=rf"^Expected {name} from .* got .*; set readout.{name}$"):
        kind(**{name: time})


def test_a_queue_that_no_time_can_say_is_refused():
    keys = np.zeros(LAST_US // 10**6 + 5, np.int64)
    with pytest.raises(ValueError, match=r"got 4 events that still wait; lower readout.service_us"):
        WaitingEvents(Bottleneck(service_us=1e6), (1, 1)).flush(keys)
