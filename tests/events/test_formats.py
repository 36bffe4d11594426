"""Event files of other programs, encoded here by the descriptions of their formats."""

import zipfile

import h5py
import lz4.frame
import numpy as np
import pytest
from backports import zstd
from event_files import (
    ENCODERS,
    HEIGHT,
    SIZE,
    WIDTH,
    aedat2_of_v2e,
    aedat4,
    evt3,
    rows,
    text,
)

from eqs.events import Events
from eqs.events.formats import decode, is_dsec, open_events
from eqs.events.hints import Hints
from eqs.events.loaded import LoadedEvents


@pytest.fixture
def events():
    generator = np.random.default_rng(0)
    t = 1_000_000 + np.sort(generator.integers(0, 90_000, 500))
    x, y, p = (generator.integers(0, high, 500) for high in (WIDTH, HEIGHT, 2))
    return Events.from_arrays(t, x, y, p, **SIZE)


@pytest.mark.parametrize("name", ENCODERS)
def test_binary_files_give_the_events_that_were_written(tmp_path, events, name):
    path = tmp_path / name
    path.write_bytes(ENCODERS[name](events))
    given = SIZE if name == "e.aedat" else {}
    found = Events.load(path, **given)
    shift = int(events.t[0]) if name == "f.es" else 0  # whose clock begins at zero
    np.testing.assert_array_equal(rows(found), rows(events.shifted(-shift)))
    assert not is_dsec(path)


def test_a_clock_of_24_bits_is_counted_on(tmp_path, events):
    late = events.shifted((1 << 24) - 1_040_000)
    (tmp_path / "a.raw").write_bytes(evt3(late))
    assert np.diff(Events.load(tmp_path / "a.raw").t).max() == np.diff(late.t).max()


@pytest.mark.parametrize("chip", ["DVS128", "DAVIS346"])
def test_addresses_of_jaer_are_turned_upright(tmp_path, chip):
    height, width = {"DVS128": (128, 128), "DAVIS346": (260, 346)}[chip]
    t, p = np.array([5, 9, 12]), [1, 0, 1]
    x, y = np.array([0, 7, 100]), np.array([0, 3, 99])
    if chip == "DVS128":
        address = (1 - np.array(p)) | (width - 1 - x) << 1 | (height - 1 - y) << 8
        special = 1 << 15
    else:
        address = np.array(p) << 11 | x << 12 | (height - 1 - y) << 22
        special = 1 << 31
    pairs = np.stack([np.append(address, special), np.append(t, 20)], axis=1)
    content = f"#!AER-DAT2.0\r\n# AEChip: a.b.{chip}\r\n".encode() + pairs.astype(">u4").tobytes()
    (tmp_path / "a.aedat").write_bytes(content)
    found = Events.load(tmp_path / "a.aedat")
    assert (found.height, found.width) == (height, width)
    np.testing.assert_array_equal(rows(found), np.stack([t, x, y, p], axis=1))


@pytest.mark.parametrize(("height", "width"), [(180, 240), (260, 346), (480, 640)])
def test_files_of_v2e_are_turned_upright_and_need_their_sensor(tmp_path, events, height, width):
    path, size = tmp_path / "a.aedat", {"height": height, "width": width}
    content = aedat2_of_v2e(events, **size)
    noise = b"# noise events are labeled as addressed external input events\r\n"
    for label in (b"", noise):
        path.write_bytes(content.replace(b"(see x)\r\n", b"(see x)\r\n" + label))
        with pytest.raises(ValueError, match=r"sensor that v2e wrote .* got none; set height"):
            decode(path)
        if label and width == 640:
            with pytest.raises(ValueError, match="labels of noise wrote over"):
                decode(path, Hints(**size))
        else:
            np.testing.assert_array_equal(rows(Events.load(path, **size)), rows(events))
    with pytest.raises(ValueError, match="got 320x240; set height and width"):
        decode(path, Hints(height=240, width=320))


@pytest.mark.parametrize(
    ("kind", "compress"), [(0, bytes), (1, lz4.frame.compress), (3, zstd.compress)]
)
def test_packets_of_aedat4_however_compressed(tmp_path, events, kind, compress):
    (tmp_path / "a.aedat4").write_bytes(aedat4(events, compression=kind, compress=compress))
    found = Events.load(tmp_path / "a.aedat4")
    np.testing.assert_array_equal(rows(found), rows(events))
    assert (found.height, found.width) == (HEIGHT, WIDTH)


def test_an_aedat4_file_without_events_says_what_it_has(tmp_path, events):
    content = aedat4(events).replace(b"EVTS</attr>", b"TRIG</attr>")
    (tmp_path / "a.aedat4").write_bytes(content)
    with pytest.raises(ValueError, match=r"Expected a stream of EVTS in .*, got TRIG"):
        Events.load(tmp_path / "a.aedat4")


def test_whole_nanoseconds_in_text_stay_exact(tmp_path):
    # As floats these differ from their neighbours by more than a microsecond's fraction.
    times = [1_676_562_141_437_616_999, 1_676_562_141_437_617_000]
    (tmp_path / "a.csv").write_text(
        "% made for a test\nt,x,y,p\n" + "".join(f"{t},1,2,1\n" for t in times)
    )
    found = decode(tmp_path / "a.csv", Hints(time_unit="ns"))
    assert found.t.tolist() == [1_676_562_141_437_616, 1_676_562_141_437_617]


def test_the_events_in_a_zip_are_found_by_name(tmp_path, events):
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("scene/calib.txt", "1 2 3 4")
        archive.writestr("scene/events.txt", text(events))
    np.testing.assert_array_equal(rows(Events.load(path, **SIZE)), rows(events))
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.txt", "1 2 3 4")
        archive.writestr("b.txt", "1 2 3 4")
    with pytest.raises(ValueError, match=r"events.txt or one text in .*, got a.txt, b.txt"):
        decode(path)


def test_rows_of_240_in_forty_bits_count_time_on(tmp_path):
    parts = [(3, 4, 1, 10), (0, 240, 0, 0), (5, 6, 0, 20)]
    content = b"".join(
        bytes([x, y, p << 7 | t >> 16, t >> 8 & 255, t & 255]) for x, y, p, t in parts
    )
    (tmp_path / "a.bin").write_bytes(content)
    found = Events.load(tmp_path / "a.bin", height=34, width=34)
    assert rows(found).tolist() == [[10, 3, 4, 1], [8212, 5, 6, 0]]


@pytest.mark.parametrize("kind", ["txt", "size", "header", "zip", "polarity"])
def test_text_in_seconds(tmp_path, events, kind):
    table = rows(events)
    lines = [f"{t / 1e6:.6f} {x} {y} {p}" for t, x, y, p in table.tolist()]
    if kind == "size":
        lines.insert(0, f"{WIDTH} {HEIGHT}")
    if kind == "header":
        lines = ["x,y,timestamp,polarity"] + [
            f"{x},{y},{t / 1e6:.6f},{p}" for t, x, y, p in table.tolist()
        ]
    if kind == "polarity":
        lines = [f"{t / 1e6:.6f} {x} {y} {2 * p - 1}" for t, x, y, p in table.tolist()]
    path = tmp_path / "events.txt"
    path.write_text("\n".join(lines))
    if kind == "zip":
        with zipfile.ZipFile(tmp_path / "events.zip", "w") as archive:
            archive.write(path, "events.txt")
        path = tmp_path / "events.zip"
    found = Events.load(path, **({} if kind == "size" else SIZE))
    np.testing.assert_array_equal(rows(found), table)


def test_whole_times_need_a_unit_and_two_readings_an_order(tmp_path, events):
    path = tmp_path / "a.npy"
    np.save(path, rows(events))
    with pytest.raises(ValueError, match=r"unit of the whole-numbered times in .*; set time_unit="):
        decode(path)
    np.testing.assert_array_equal(
        rows(decode(path, Hints(time_unit="us")).events(**SIZE)), rows(events)
    )
    nanoseconds = rows(events) * [1000, 1, 1, 1]
    np.save(path, nanoseconds)
    np.testing.assert_array_equal(
        rows(decode(path, Hints(time_unit="ns")).events(**SIZE)), rows(events)
    )
    np.save(path, np.array([[0, 0, 0, 0], [1, 1, 1, 1]]))
    with pytest.raises(ValueError, match=r"fit one order in .*, got txyp and .*; set order"):
        decode(path, Hints(time_unit="us"))
    assert decode(path, Hints(order="xypt", time_unit="us")).t.tolist() == [0, 1]


@pytest.mark.parametrize("kind", ["v2e", "mvsec", "event_utils", "m3ed", "npz", "fields"])
def test_tables_of_other_programs(tmp_path, events, kind):
    table, path = rows(events), tmp_path / "a.h5"
    columns = dict(zip("txyp", table.T, strict=True))
    if kind == "npz":
        path = tmp_path / "a.npz"
        np.savez(path, t=columns["t"] / 1e6, x=columns["x"], y=columns["y"], p=columns["p"])
    elif kind == "fields":
        path = tmp_path / "a.npy"
        made = np.zeros(
            len(table), [("timestamp", "f8"), ("x", "u2"), ("y", "u2"), ("polarity", "?")]
        )
        made["timestamp"], made["polarity"] = columns["t"] / 1e6, columns["p"]
        made["x"], made["y"] = columns["x"], columns["y"]
        np.save(path, made)
    else:
        with h5py.File(path, "w") as file:
            if kind == "v2e":
                file["events"] = table.astype(np.uint32)
            elif kind == "mvsec":
                seconds = np.stack([table[:, 1], table[:, 2], table[:, 0] / 1e6, table[:, 3]], 1)
                file["davis/left/events"] = seconds
            elif kind == "event_utils":
                file["events/ts"], file["events/ps"] = columns["t"] / 1e6, columns["p"]
                file["events/xs"], file["events/ys"] = columns["x"], columns["y"]
            else:
                for name, values in columns.items():
                    file[f"prophesee/left/{name}"] = values
    found = decode(path).events(**SIZE)
    np.testing.assert_array_equal(rows(found), table)


def test_disorder_is_sorted_stably_and_counted(tmp_path):
    np.save(tmp_path / "a.npy", np.array([[5, 1, 0, 1], [3, 2, 0, 1], [5, 3, 0, 0], [4, 4, 0, 1]]))
    found = decode(tmp_path / "a.npy", Hints(order="txyp", time_unit="us"))
    assert found.disorder == 2
    assert found.events(**SIZE).x.tolist() == [2, 4, 1, 3]


def test_any_file_can_be_scored_like_a_reader(tmp_path, events):
    path = tmp_path / "a.raw"
    path.write_bytes(evt3(events))
    with open_events(path, rows=20) as stream:
        assert isinstance(stream, LoadedEvents)
        assert stream.height == 20
        assert len(stream) == int((events.y < 20).sum())
        assert stream.extent_us == (stream.events.t[0], stream.events.t[-1] + 1)
    events.save(tmp_path / "b.h5")
    assert is_dsec(tmp_path / "b.h5")


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.xyz", b"nothing known", "got none of them; convert it"),
        ("a.raw", b"% evt 4.0\n% end\n", "got EVT4.0; convert it"),
        ("a.aedat", b"#!AER-DAT2.0\n# AEChip: some.Chip\n", "got the chip CHIP"),
        ("a.es", b"Event Stream\x03\x00\x00\x01" + bytes(8), "got version 3 and kind 1"),
        ("a.bin", b"1234567", "whole events of 5 bytes"),
        ("a.txt", b"one two three four\nfive", "Expected"),
        ("a.npy", b"\x93NUMPY\x01", "arrays of events"),
    ],
)
def test_what_cannot_be_read_is_named(tmp_path, name, content, said):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=said):
        Events.load(tmp_path / name, **SIZE)
