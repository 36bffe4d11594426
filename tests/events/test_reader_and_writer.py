"""Event files: what is written is read back, in any window, and every bad file is named."""

import multiprocessing
import pickle
import zlib
from itertools import pairwise

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eqs.events import EventReader, Events, EventWriter


def same(a, b):
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in "txyp")


@pytest.fixture
def stored(tmp_path, make_events):
    """A stream of a recording whose clock starts late, and its file."""
    events = make_events(5000, start_us=10_000_000_123, stop_us=10_000_300_456)
    events.save(tmp_path / "events.h5")
    return events, tmp_path / "events.h5"


def plain_file(path, t=(0, 1500), x=(1, 2), y=(1, 2), p=(0, 1), ms_to_idx=(0, 1), t_offset=0, **of):
    """An uncompressed file with the given contents, of the types the values have."""
    with h5py.File(path, "w") as file:
        for name, values in {"t": t, "x": x, "y": y, "p": p}.items():
            if values is not None:
                file[f"events/{name}"] = np.asarray(values)
        if ms_to_idx is not None:
            file["ms_to_idx"] = np.asarray(ms_to_idx, np.uint64)
        file["t_offset"] = t_offset if isinstance(t_offset, str) else np.int64(t_offset)
        file.attrs.update(**{"height": 24, "width": 32, **of})
    return path


def test_round_trip_keeps_everything(stored):
    events, path = stored
    loaded = Events.load(path)
    assert same(events, loaded)
    assert (loaded.height, loaded.width) == (24, 32)


def test_layout_is_that_of_dsec(stored):
    events, path = stored
    with h5py.File(path) as file:
        types = {name: file[f"events/{name}"].dtype for name in "txyp"}
        index, t = file["ms_to_idx"][:], file["events/t"][:].astype(np.int64)
        assert types == {"t": np.uint32, "x": np.uint16, "y": np.uint16, "p": np.uint8}
        assert index.dtype == np.uint64
        assert file["t_offset"][()] == events.t[0]
        assert file["events/t"].id.get_create_plist().get_filter(0)[0] == 32001
    expected = np.searchsorted(t, 1000 * np.arange(t[-1] // 1000 + 1))
    np.testing.assert_array_equal(index, expected)


@settings(max_examples=60, deadline=None)
@given(start=st.integers(-5_000, 305_000), length=st.integers(0, 200_000))
def test_any_window_equals_the_slice_in_memory(window_case, start, length):
    events, reader = window_case
    start += 10_000_000_000
    assert same(reader.window(start, start + length), events.window(start, start + length))


@pytest.fixture(scope="module")
def window_case(tmp_path_factory):
    generator = np.random.default_rng(3)
    t = 10_000_000_123 + np.sort(generator.integers(0, 300_000, 4000))
    t[1000:1200] = t[1000]  # many events in one microsecond
    t[2000:2500] += np.int64(2000) * (np.arange(500) > 250)  # and milliseconds without any
    t = np.sort(t)
    x, y, p = (generator.integers(0, top, 4000) for top in (32, 24, 2))
    events = Events.from_arrays(t, x, y, p, height=24, width=32)
    path = tmp_path_factory.mktemp("window") / "events.h5"
    events.save(path)
    with EventReader(path) as reader:
        yield events, reader


def test_windows_outside_the_recording_are_empty(stored):
    events, path = stored
    with EventReader(path) as reader:
        assert len(reader.window(0, reader.start_us)) == 0
        assert len(reader.window(reader.stop_us, reader.stop_us + 50_000)) == 0
        assert len(reader.window(reader.start_us + 5, reader.start_us)) == 0
        assert same(reader.window(0, 2**60), events)
        assert reader.stop_us == events.t[-1] + 1
        assert len(reader) == len(events)


def test_pieces_give_the_same_file_as_the_whole(tmp_path, make_events):
    events = make_events(90_000, stop_us=700_000)
    events.save(tmp_path / "whole.h5")
    with EventWriter(tmp_path / "pieces.h5", 24, 32) as writer:
        for cut in (slice(0, 1), slice(1, 1), slice(1, 40_000), slice(40_000, None)):
            writer.append(events[cut])
    assert (tmp_path / "whole.h5").read_bytes() == (tmp_path / "pieces.h5").read_bytes()
    assert same(Events.load(tmp_path / "pieces.h5"), events)


def test_empty_stream_round_trip(tmp_path):
    Events.empty(4, 5).save(tmp_path / "none.h5")
    loaded = Events.load(tmp_path / "none.h5")
    assert (len(loaded), loaded.height, loaded.width) == (0, 4, 5)


def test_given_offset_is_stored(tmp_path, make_events):
    events = make_events(100, start_us=2_000, stop_us=9_000)
    with EventWriter(tmp_path / "e.h5", 24, 32, t_offset_us=1_000) as writer:
        writer.append(events)
    with h5py.File(tmp_path / "e.h5") as file:
        assert file["t_offset"][()] == 1_000
    assert same(Events.load(tmp_path / "e.h5"), events)


def test_file_appears_only_when_complete(tmp_path, make_events):
    path = tmp_path / "deep" / "events.h5"
    with EventWriter(path, 24, 32) as writer:
        writer.append(make_events(100))
        assert not path.exists()
    assert path.exists()
    assert [file.name for file in path.parent.iterdir()] == ["events.h5"]


def test_exception_leaves_the_old_file_and_no_partial_one(tmp_path, make_events):
    path = tmp_path / "events.h5"
    old = make_events(10)
    old.save(path)

    def interrupted():
        with EventWriter(path, 24, 32) as writer:
            writer.append(make_events(50_000, seed=1))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [file.name for file in tmp_path.iterdir()] == ["events.h5"]
    assert same(Events.load(path), old)


def _count_window(reader):
    return len(reader.window(reader.start_us, reader.start_us + 100_000))


def test_reader_travels_to_other_processes(stored):
    events, path = stored
    with EventReader(path) as reader:
        expected = _count_window(reader)
        assert _count_window(pickle.loads(pickle.dumps(reader))) == expected
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            assert pool.apply(_count_window, (reader,)) == expected
    assert expected == len(events.window(events.t[0], events.t[0] + 100_000))


def test_reader_reopens_after_close(stored):
    events, path = stored
    reader = EventReader(path)
    assert len(reader.read()) == len(events)
    reader.close()
    assert len(reader.read()) == len(events)
    reader.close()


def test_size_comes_from_the_file_or_the_arguments(tmp_path):
    path = plain_file(tmp_path / "e.h5")
    with h5py.File(path, "a") as file:
        del file.attrs["height"], file.attrs["width"]
    assert Events.load(path, height=24, width=40).width == 40
    with pytest.raises(ValueError, match=r"sensor's height .*e\.h5.*data\.size"):
        Events.load(path)


def test_other_size_than_stated_is_refused(stored):
    with pytest.raises(ValueError, match=r"width 640, got 32 .*set data\.size"):
        Events.load(stored[1], height=24, width=640)


def test_top_rows_look_like_a_smaller_sensor(stored):
    events, path = stored
    with EventReader(path, rows=10) as reader:
        part = reader.read()
        assert (reader.height, part.height, part.width) == (10, 10, 32)
        assert reader.window(0, 1).height == 10
    keep = events.y < 10
    assert 0 < keep.sum() < len(events)
    for name in "txyp":
        np.testing.assert_array_equal(getattr(part, name), getattr(events, name)[keep])
    assert same(EventReader(path, rows=99).read(), events)


def test_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nowhere\.h5, found none.*data\.root"):
        Events.load(tmp_path / "nowhere.h5")


def test_truncated_file(stored):
    path = stored[1]
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(ValueError, match=r"events\.h5 to be a whole HDF5 file"):
        Events.load(path)


def test_foreign_file(tmp_path):
    (tmp_path / "text.h5").write_text("t x y p\n")
    with pytest.raises(ValueError, match="whole HDF5 file"):
        Events.load(tmp_path / "text.h5")
    path = plain_file(tmp_path / "e.h5", p=None, ms_to_idx=None)
    with pytest.raises(ValueError, match=r"p, t and ms_to_idx.*got events/t, events/x"):
        Events.load(path)


@pytest.mark.parametrize(
    ("contents", "message"),
    [
        ({"t": (1500, 0)}, "sorted by time"),
        ({"t": (0, 1500, 1400, 1600), "x": [1] * 4, "y": [1] * 4, "p": [1] * 4}, "sorted by time"),
        ({"t": (-5, 1500)}, "zero or more.* got -5 us"),
        ({"t_offset": -7000}, "zero or more.* got -7000 us"),
        ({"x": (1, 32)}, "inside the 32x24 sensor, got x up to 32"),
        ({"y": (24, 1)}, "inside the 32x24 sensor"),
        ({"p": (0, 3)}, "polarities 0 and 1, got 3"),
        ({"t": (0.0, 0.1)}, "events/t .* whole numbers, got float64"),
        ({"x": (1,)}, "one length .*'x': 1"),
        ({"ms_to_idx": (0, 5)}, "ms_to_idx .*rise from 0 to at most 2"),
        (
            {"ms_to_idx": ((0, 1),)},
            r"ms_to_idx .* row of whole numbers, got uint64 of shape \(1, 2\)",
        ),
        ({"t_offset": (1, 2, 3)}, r"t_offset .* one whole number, got int64 of shape \(3,\)"),
        ({"t_offset": "noon"}, "t_offset .* one whole number, got .S4 of shape"),
        ({"p": np.int8([-1, 1])}, r"events\.p .* fit uint8, got values from -1 to 1"),
        ({"x": np.int32([1, 65541])}, r"events\.x .* fit uint16, got values from 1 to 65541"),
        ({"t": (-5, 1500), "t_offset": 9000}, "zero or more.*-5 in events/t, 9000 in t_offset"),
    ],
)
def test_bad_contents(tmp_path, contents, message):
    path = plain_file(tmp_path / "bad.h5", **contents)
    with pytest.raises(ValueError, match=message) as caught:
        Events.load(path)
    assert str(path) in str(caught.value)


def test_attributes_that_are_no_sizes(tmp_path):
    path = plain_file(tmp_path / "e.h5")
    with h5py.File(path, "r+") as file:
        file.attrs["height"] = "tall"
    with pytest.raises(ValueError, match=r"attribute height of .*one whole number"):
        Events.load(path)


def test_index_that_hides_events_is_noticed(tmp_path):
    path = plain_file(
        tmp_path / "e.h5", t=(0, 1500, 2500), x=[1] * 3, y=[1] * 3, p=[1] * 3, ms_to_idx=(0, 1, 1)
    )
    with EventReader(path) as reader:
        assert len(reader.read()) == 3
        with pytest.raises(ValueError, match="ms_to_idx to agree with events/t"):
            reader.window(1000, 2000)


def test_writer_refuses_what_the_layout_cannot_hold(tmp_path, make_events):
    events = make_events(100, start_us=5_000, stop_us=9_000)

    def write(*streams, **options):
        with EventWriter(tmp_path / "e.h5", 24, 32, **options) as writer:
            for stream in streams:
                writer.append(stream)

    with pytest.raises(ValueError, match="append streams in time order"):
        write(events, events)
    with pytest.raises(ValueError, match="at or after 8000 us"):
        write(events, t_offset_us=8_000)
    with pytest.raises(ValueError, match=r"times of zero or more for .*; add 990 to all of them"):
        write(events.shifted(-6_000))
    with pytest.raises(ValueError, match=r"of a 32x24 sensor .*got 9x9"):
        write(Events.empty(9, 9))
    with pytest.raises(ValueError, match="recording of at most 86400000000 us"):
        write(Events.concatenate([events, events.shifted(90_000_000_000)]))
    assert list(tmp_path.iterdir()) == []


def test_recordings_of_more_than_71_minutes(tmp_path, make_events, caplog):
    """Times beyond 32 bits come back; where a piece ended leaves no trace; it is said."""
    events = make_events(90_000, start_us=1_000, stop_us=5_000_000_000)
    for name, cuts in (("whole", [0, 90_000]), ("cut", [0, 7, 50_001, 77_300, 90_000])):
        with EventWriter(tmp_path / name, 24, 32) as writer:
            for first, last in pairwise(cuts):
                writer.append(events[first:last])
    assert "longer than 71 minutes: its times take 64 bits" in caplog.text
    assert (tmp_path / "whole").read_bytes() == (tmp_path / "cut").read_bytes()
    with EventReader(tmp_path / "whole") as reader:
        assert same(reader.read(), events)
        late = reader.window(4_400_000_000, 4_500_000_000)
    inside = (events.t >= 4_400_000_000) & (events.t < 4_500_000_000)
    assert (late.t == events.t[inside]).all()
    assert len(late) > 0


def test_more_events_than_31_bits_count(tmp_path):
    """Two billion events at zero, and three behind them."""
    path, many, chunk = tmp_path / "e.h5", 2**31 + 1000, 2**24
    with h5py.File(path, "w") as file:
        for name, dtype in {"t": "u4", "x": "u2", "y": "u2", "p": "u1"}.items():
            column = file.create_dataset(
                f"events/{name}", (many,), dtype, chunks=(chunk,), compression="gzip"
            )
            packed = zlib.compress(bytes(chunk * column.dtype.itemsize), 1)
            for first in range(0, many, chunk):
                column.id.write_direct_chunk((first,), packed)
            column[-3:] = [5_000, 5_500, 6_000] if name == "t" else 1
        file["ms_to_idx"] = np.array([0, *[many - 3] * 5, many - 1], np.uint64)
    with EventReader(path, height=2, width=2) as reader:
        assert len(reader) == many
        assert reader.window(5_000, 6_000).t.tolist() == [5_000, 5_500]
        assert reader.stop_us == 6_001


def test_a_clock_that_began_again_is_to_be_unwrapped(tmp_path):
    t = np.array([2**32 - 20, 2**32 - 10, 5, 15], np.int64)
    ones = np.zeros(4, int)
    with pytest.raises(ValueError, match=r"unwrap the clock, which began again at 2\^32: add 4"):
        Events.from_arrays(t, ones, ones, ones, height=2, width=2)
    for times, advice in ((t, "unwrap the clock"), (np.array([15, 5, 3, 1]), "sort the stream")):
        path = tmp_path / "e.h5"
        with h5py.File(path, "w") as file:
            for name, values in {"t": times, "x": ones, "y": ones, "p": ones}.items():
                file[f"events/{name}"] = values.astype(np.uint32)
            file["ms_to_idx"] = np.zeros(2, np.uint64)
        with pytest.raises(ValueError, match=advice):
            EventReader(path, height=2, width=2).read()
