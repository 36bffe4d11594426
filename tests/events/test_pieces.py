"""Files in pieces of any size are the whole files, in order, whatever comes late."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from event_files import (
    ENCODERS,
    HEIGHT,
    SIZE,
    TOLD,
    WIDTH,
    aedat2,
    aedat2_of_v2e,
    csv,
    evt3,
    forty_bits,
    rows,
    text,
)

from eqs.events import Events, EventWriter
from eqs.events.decoded import Decoded, joined
from eqs.events.formats import decode, pieces
from eqs.events.hints import Hints
from eqs.events.ordered import OrderedFile, in_order

MADE = {
    **ENCODERS, "g.aedat": aedat2, "h.aedat": aedat2_of_v2e, "i.bin": forty_bits, "j.txt": text,
    "k.csv": csv,
}  # fmt: skip


def stream(count, stop_us=90_000, start_us=1_000_000, seed=0):
    generator = np.random.default_rng(seed)
    t = start_us + np.sort(generator.integers(0, stop_us, count))
    x, y, p = (generator.integers(0, high, count) for high in (WIDTH, HEIGHT, 2))
    return Events.from_arrays(t, x, y, p, **SIZE)


@pytest.mark.parametrize("size", [1, 2, 3, 5, 7, 8, 13, 64, 1009, 1 << 20])
@pytest.mark.parametrize("name", MADE)
def test_pieces_of_any_size_are_the_whole(tmp_path, name, size):
    path, hints = tmp_path / name, Hints(**TOLD.get(name, {}))
    # Half a second before a clock of 24 bits begins again.
    path.write_bytes(MADE[name](stream(300, 400_000, (1 << 24) - 200_000)))
    whole = decode(path, hints)
    parts = list(pieces(path, hints, size))
    assert len(whole.t) == 300
    assert len(parts) > 3 or size > 512
    for field in "txyp":
        found = np.concatenate([getattr(part, field) for part in parts])
        np.testing.assert_array_equal(found, getattr(whole, field))
    assert {(part.kind, part.height, part.width) for part in parts} == {
        (whole.kind, whole.height, whole.width)
    }


@pytest.mark.parametrize("name", MADE)
def test_a_file_without_events_is_one_piece_of_none(tmp_path, name):
    path, hints = tmp_path / name, Hints(**TOLD.get(name, {}))
    path.write_bytes(MADE[name](stream(1)[:0]) if name != "f.es" else MADE[name](stream(1))[:20])
    if name == "j.txt":
        with pytest.raises(ValueError, match=r"Expected four numbers a line in .*, got none"):
            decode(path, hints)
    else:
        assert sum(len(part.t) for part in pieces(path, hints)) == 0
        size = {} if decode(path, hints).height else SIZE
        assert [len(part) for part in OrderedFile(path, replace(hints, **size))] == [0]


def decoded_parts(t, cuts):
    """Pieces with these times; columns count the events."""
    t, x = np.array(t), np.arange(len(t))
    whole = Decoded(kind="made", t=t, x=x, y=x * 0, p=x * 0)
    edges = [0, *sorted(cuts), len(t)]
    return [whole[start:stop] for start, stop in pairwise(edges)]


@pytest.mark.parametrize("seed", range(30))
def test_late_events_find_their_place(tmp_path, seed):
    generator = np.random.default_rng(seed)
    t = np.sort(generator.integers(0, 60, 100))
    moved = generator.permuted(t.reshape(10, 10), axis=1).ravel()  # at most nine places
    cuts = generator.integers(0, 101, generator.integers(0, 12))
    found = joined(in_order(decoded_parts(moved, cuts), 9, tmp_path), "")
    order = np.argsort(moved, kind="stable")
    assert found.t.tolist() == t.tolist()
    assert found.x.tolist() == order.tolist()


def test_what_comes_too_late_is_named_and_whole_sorts_it(tmp_path):
    path = tmp_path / "a.txt"
    times = [*range(10, 40), 5]
    path.write_text("".join(f"0.{time:06d} 1 2 1\n" for time in times))
    hints = Hints(**SIZE, order="txyp")
    file = OrderedFile(path, hints, held=4, size=64)
    # Pieces are joined until they are worth a sort, so that a small file is sorted all the same.
    assert [int(each) for part in file for each in part.t] == sorted(times)
    said = "at most 4 places late in .*, got one at 5 us after one at 39 us; add --whole"
    with pytest.raises(ValueError, match=said):
        list(in_order(decoded_parts(times, range(31)), 4, path))
    whole = OrderedFile(path, hints, held=None, size=64)
    assert [int(each) for part in whole for each in part.t] == sorted(times)
    assert (file.disorder, whole.disorder) == (1, 1)


def test_faults_are_counted_over_all_pieces(tmp_path, monkeypatch):
    monkeypatch.setattr("eqs.events.ordered.PIECE_EVENTS", 7)
    words = evt3(stream(50))
    start = words.index(b"% end\n") + 6
    early = np.array([2 << 12 | 5, 2 << 12 | 6], "<u2").tobytes()
    (tmp_path / "a.raw").write_bytes(words[:start] + early + words[start:])
    file = OrderedFile(tmp_path / "a.raw", size=32)
    parts = list(file)
    assert max(len(part) for part in parts) <= 7
    np.testing.assert_array_equal(np.concatenate([rows(part) for part in parts]), rows(stream(50)))
    assert (file.dropped, file.disorder, file.kind) == (2, 0, "a RAW file (EVT3)")


@pytest.mark.parametrize("count", [0, 1, 1000])
def test_a_file_of_dsec_is_cut_where_its_index_says(tmp_path, monkeypatch, count):
    monkeypatch.setattr("eqs.events.ordered.PIECE_EVENTS", 100)
    events = stream(count)
    with EventWriter(tmp_path / "a.h5", **SIZE) as writer:
        writer.append(events)
        writer.span_us = (900_000, 1_200_000)
    file = OrderedFile(tmp_path / "a.h5")
    parts = list(file)
    np.testing.assert_array_equal(np.concatenate([rows(part) for part in parts]), rows(events))
    assert file.span_us == (900_000, 1_200_000)
    if count == 1000:
        assert 8 <= len(parts) <= 11
        assert max(len(part) for part in parts) < 200
