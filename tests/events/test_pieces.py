"""Files read in pieces: the same events however they are cut, in order, in bounded memory."""

import numpy as np
import pytest
from test_formats import HEIGHT, SIZE, WIDTH, evt2, evt3, evt21, rows

from eqs.commands.info import described
from eqs.events import Events, EventWriter
from eqs.events import pieces as module
from eqs.events.formats import decode
from eqs.events.pieces import EventPieces, ReadAs
from eqs.events.raw import raw_pieces

HEADERS = {
    "evt2": b"% evt 2.0\n% end\n",
    "evt21": b"% evt 2.1\n% end\n",
    "evt3": b"% evt 3.0\n% end\n",
}


def stream(count=3_000, stop_us=40_000_000):
    generator = np.random.default_rng(0)
    t = 1_000_000 + np.sort(generator.integers(0, stop_us, count))
    x, y, p = (generator.integers(0, high, count) for high in (WIDTH, HEIGHT, 2))
    return Events.from_arrays(t, x, y, p, **SIZE)


def words(kind, seed):
    """Words of which half say times, rows and bases, and half anything."""
    generator = np.random.default_rng(seed)
    if kind == "evt3":
        kinds = generator.choice([0, 2, 3, 4, 5, 6, 8, 8, 14], 900).astype(np.int64)
        return (kinds << 12 | generator.integers(0, 4096, 900)).astype("<u2").tobytes()
    bits = 28 if kind == "evt2" else 60
    kinds = generator.choice([0, 1, 8], 300).astype(np.uint64)
    rest = generator.integers(0, 1 << bits, 300, dtype=np.uint64)
    return (kinds << np.uint64(bits) | rest).astype("<u4" if bits == 28 else "<u8").tobytes()


def fields(parts):
    parts = list(parts)
    dropped = sum(part.dropped for part in parts)
    return [np.concatenate([getattr(part, n) for part in parts]).tolist() for n in "txyp"], dropped


@pytest.mark.parametrize("kind", HEADERS)
@pytest.mark.parametrize("seed", range(4))
def test_words_mean_the_same_however_they_are_cut(tmp_path, kind, seed):
    path = tmp_path / "a.raw"
    path.write_bytes(HEADERS[kind] + words(kind, seed) + b"\x01")
    whole = fields(raw_pieces(path, 1 << 30))
    assert len(whole[0][0]) > 50
    for at_once in (1, 6, 10, 62, 256, 1_000):
        assert fields(raw_pieces(path, at_once)) == whole


@pytest.mark.parametrize("encode", [evt2, evt21, evt3])
def test_a_clock_that_turns_between_pieces_counts_on(tmp_path, encode):
    events = stream()
    path = tmp_path / "a.raw"
    path.write_bytes(encode(events))
    found, _ = fields(raw_pieces(path, 200))
    expected = rows(events).T
    if encode is evt3:  # whose clock has 24 bits and begins anywhere
        expected[0] -= expected[0, 0] - found[0][0]
    assert np.array(found).tolist() == expected.tolist()


def test_pieces_are_the_sorted_whole(tmp_path, monkeypatch):
    events = stream()
    table = rows(events)
    generator = np.random.default_rng(1)
    late = np.argsort(table[:, 0] + generator.integers(0, 500_000, len(table)), kind="stable")
    words = []
    for t, x, y, p in table[late].tolist():
        words += [8 << 28 | t >> 6, p << 28 | (t & 63) << 22 | x << 11 | y]
    path = tmp_path / "a.raw"
    path.write_bytes(HEADERS["evt2"] + np.array(words, "<u4").tobytes())
    plain = raw_pieces
    monkeypatch.setattr(module, "raw_pieces", lambda path: plain(path, 400))
    pieces = EventPieces(path, ReadAs(**SIZE))
    parts = list(pieces)
    assert len(parts) > 10
    whole = decode(path)
    assert np.array_equal(
        np.concatenate([rows(part) for part in parts]), rows(whole.events(**SIZE))
    )
    assert pieces.disorder == whole.disorder > 0
    words[-2] = 8 << 28
    path.write_bytes(HEADERS["evt2"] + np.array(words, "<u4").tobytes())
    with pytest.raises(ValueError, match=r"at most 1000000 us after younger ones .*sort the file"):
        list(EventPieces(path, ReadAs(**SIZE)))


def test_every_kind_comes_in_pieces_and_is_described(tmp_path):
    events = stream(500, 3_000_000)
    with EventWriter(tmp_path / "a.h5", **SIZE) as writer:
        writer.append(events)
        writer.span_us = (900_000, 4_100_000)
    np.save(tmp_path / "b.npy", rows(events))
    (tmp_path / "c.raw").write_bytes(evt2(events))
    for name in ("a.h5", "b.npy", "c.raw"):
        pieces = EventPieces(tmp_path / name, ReadAs(time_unit="us", **SIZE))
        assert np.array_equal(np.concatenate([rows(part) for part in pieces]), rows(events))
    pieces = EventPieces(tmp_path / "a.h5")
    said = "\n".join(described(pieces))
    assert len(list(pieces)) == 3  # a second each
    assert "sensor      64 x 48" in said
    assert "events      500" in said
    assert f"longest gap {np.diff(events.t).max()} us" in said
    assert f"brighter    {100 * events.p.mean():.1f} %" in said
    assert "watched     900000 to 4100000 us" in said
    assert "disorder    0 events" in said
    assert "longest" not in "\n".join(described(EventPieces(_empty(tmp_path))))


def _empty(folder):
    (folder / "empty.raw").write_bytes(b"% evt 2.0\n% geometry 64x48\n% end\n")
    return folder / "empty.raw"
