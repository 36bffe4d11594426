"""Arrays of CARLA's event camera: records as NumPy saves them, raw bytes, columns, tick by tick."""

import numpy as np
import pytest

from eqs.commands.convert import main as convert
from eqs.events import Events, Hints
from eqs.events.carla import PACKED, PADDED
from eqs.events.formats import decode, open_events

SIZE = {"height": 48, "width": 64}
DOCUMENTED = np.dtype([("x", np.uint16), ("y", np.uint16), ("t", np.int64), ("pol", bool)])


def records(count=400, kind=PACKED, start_ns=0, seed=0):
    """A tick's events, many at equal times, in no order of place."""
    generator = np.random.default_rng(seed)
    table = np.zeros(count, kind)
    table["t"] = start_ns + 1000 * np.sort(generator.integers(0, 100, count)) + 999
    for name, high in (("x", 64), ("y", 48), ("pol", 2)):
        table[name] = generator.integers(0, high, count)
    return table


def wanted(table):
    """Rows of t, y, x and p in their order, by Python's own sorting."""
    rows = zip(*(table[name].tolist() for name in ("t", "y", "x", "pol")), strict=True)
    return sorted((t // 1000, y, x, int(p)) for t, y, x, p in rows)


def found(events):
    rows = zip(*(getattr(events, name).tolist() for name in "tyxp"), strict=True)
    return [tuple(row) for row in rows]


def places(rows):
    """Without polarity, by which events of one pixel and time are not sorted."""
    return [row[:3] for row in rows]


def test_the_records_are_those_that_carla_packs():
    assert (PACKED.itemsize, PADDED.itemsize) == (13, 24)
    assert DOCUMENTED == PACKED
    assert np.dtype(DOCUMENTED.descr, align=True) == PADDED


@pytest.mark.parametrize("name", ["a.npy", "a.raw", "a.bin"])
@pytest.mark.parametrize("kind", [PACKED, PADDED])
def test_saved_and_raw_records_are_read_by_time_row_and_column(tmp_path, name, kind):
    table = records(kind=kind)
    if name == "a.npy":
        np.save(tmp_path / name, table)
    else:
        (tmp_path / name).write_bytes(table.tobytes())
    events = Events.load(tmp_path / name, **SIZE)
    assert places(found(events)) == places(wanted(table))
    assert sorted(found(events)) == wanted(table)
    assert open_events(tmp_path / name, **SIZE).start_us == events.t[0]
    with pytest.raises(ValueError, match="Expected the sensor's height, which events of CARLA"):
        Events.load(tmp_path / name)


def test_bytes_of_other_files_are_none_of_carla(tmp_path):
    # 13 events of N-MNIST take as many bytes as five of CARLA.
    content = b"".join(bytes([3, 4, 0x80, k, 10]) for k in range(13))
    (tmp_path / "a.bin").write_bytes(content)
    assert decode(tmp_path / "a.bin").t.tolist() == [256 * k + 10 for k in range(13)]
    (tmp_path / "b.raw").write_bytes(records().tobytes()[:-1])
    with pytest.raises(ValueError, match="arrays of CARLA, 40-bit"):
        decode(tmp_path / "b.raw")
    # An event in column 37 begins with the byte that begins RAW files.
    table = records(3)
    table["x"][0] = ord("%")
    (tmp_path / "c.raw").write_bytes(table.tobytes())
    assert len(decode(tmp_path / "c.raw").t) == 3


@pytest.mark.parametrize("suffix", ["npy", "raw"])
def test_ticks_are_one_stream(tmp_path, suffix, capsys):
    ticks = [records(count, start_ns=100_000 * k, seed=k) for k, count in enumerate([50, 0, 80, 9])]
    folder = tmp_path / "ticks"
    folder.mkdir()
    for number, table in zip((9, 10, 11, 100), ticks, strict=True):
        if suffix == "npy":
            np.save(folder / f"{number}.npy", table)
        else:
            (folder / f"{number}.raw").write_bytes(table.tobytes())
    (folder / "notes.txt").write_text("Town10")
    expected = wanted(np.concatenate(ticks))
    assert places(found(Events.load(folder, **SIZE))) == places(expected)
    out = tmp_path / "events.h5"
    convert([str(folder), str(out), "--height", "48", "--width", "64"], "eqs convert")
    assert capsys.readouterr().out == f"{out}: 139 events of events of CARLA, times in ns\n"
    assert places(found(Events.load(out))) == places(expected)


def test_a_folder_of_several_kinds_or_none_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"Expected a bag of ROS 2 .* got neither; name a file"):
        Events.load(tmp_path)
    np.save(tmp_path / "1.npy", records())
    (tmp_path / "2.raw").write_bytes(records().tobytes())
    with pytest.raises(ValueError, match=r"got \.npy and \.raw; name a file, or keep one kind"):
        Events.load(tmp_path, **SIZE)
    with pytest.raises(FileNotFoundError, match="Expected an event file at"):
        Events.load(tmp_path / "gone", **SIZE)


def test_plain_columns_need_their_unit(tmp_path):
    table = records()
    columns = np.stack([table[name].astype(np.int64) for name in ("x", "y", "t", "pol")], axis=1)
    np.save(tmp_path / "a.npy", columns)
    with pytest.raises(ValueError, match="set time_unit=us, ns"):
        decode(tmp_path / "a.npy")
    told = decode(tmp_path / "a.npy", Hints(time_unit="ns"))
    assert sorted(found(told.events(**SIZE))) == wanted(table)


def test_another_unit_counts_where_it_is_told(tmp_path):
    np.save(tmp_path / "a.npy", records())
    told = decode(tmp_path / "a.npy", Hints(time_unit="us"))
    np.testing.assert_array_equal(told.t, np.sort(records()["t"]))
