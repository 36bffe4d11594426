"""MATLAB files, written by SciPy (version 5) and by hand (version 7.3)."""

import numpy as np
import pytest
from event_files import save73
from scipy.io import savemat

from eqs.events.formats import decode
from eqs.events.hints import Hints

T, X, Y, P = [10, 12, 40], [0, 7, 3], [2, 0, 5], [1, 0, 1]
SIZE = {"height": 6, "width": 8}
COLUMNS = {"x": np.array(X), "y": np.array(Y), "ts": np.array(T), "p": np.array(P)}
ONE_BASED = {**COLUMNS, "x": COLUMNS["x"] + 1, "y": COLUMNS["y"] + 1}


def read(path, **hints):
    events = decode(path, Hints(**SIZE, **hints)).events(**SIZE)
    return [getattr(events, name).tolist() for name in "txyp"]


@pytest.mark.parametrize("save", [savemat, save73])
@pytest.mark.parametrize(
    ("variables", "hints"),
    [
        (COLUMNS, {"time_unit": "us"}),
        ({"x": X, "y": Y, "t": np.array(T) / 1e6, "pol": 2 * np.array(P) - 1}, {}),
        ({"events": COLUMNS, "size": np.array([6, 8])}, {"time_unit": "us"}),
        ({"data": {"inner": COLUMNS}}, {"time_unit": "us"}),
        ({"TD": {**ONE_BASED, "p": COLUMNS["p"] + 1}}, {}),
        ({"TD": {**ONE_BASED, "p": 2 * COLUMNS["p"] - 1}}, {"first_pixel": 1}),
        ({"events": np.array([X, Y, T, P]).T}, {"order": "xytp", "time_unit": "us"}),
    ],
)
def test_variables_structs_and_matrices(tmp_path, save, variables, hints):
    save(tmp_path / "a.mat", variables)
    assert read(tmp_path / "a.mat", **hints) == [T, X, Y, P]


def test_pixels_that_reach_the_size_count_from_one(tmp_path):
    wide = {**ONE_BASED, "x": np.array([1, 8, 4])}
    savemat(tmp_path / "a.mat", wide)
    assert read(tmp_path / "a.mat", time_unit="us") == [T, [0, 7, 3], Y, P]


@pytest.mark.parametrize(
    ("variables", "hints", "said"),
    [
        (COLUMNS, {}, "unit of the whole-numbered times in .*; set time_unit"),
        (
            {**COLUMNS, "x": [1, 7, 3], "y": [2, 1, 5]},
            {"time_unit": "us"},
            "count from 0 or from 1, got .*; set first_pixel=0 or 1",
        ),
        ({"a": np.array([T, X, Y, P]).T, "b": np.zeros((3, 4))}, {}, "or one matrix .*, got a, b"),
        (
            {"a": COLUMNS, "b": COLUMNS},
            {},
            "Expected one set of x, y, t and p, .*; save the events",
        ),
        ({"a": np.array([[1, 0, 0, 1], [2, 1, 1, 0]])}, {}, "fit one order in .*; set order"),
        ({**COLUMNS, "t": np.array(T)}, {}, "Expected one of ts and t, got both"),
        ({"x": X, "y": Y, "t": T}, {}, "got t, x, y; save the events alone"),
        ({**COLUMNS, "p": np.array([0, 1, 7])}, {"time_unit": "us"}, "polarities of 0 and 1 or -1"),
        ({**COLUMNS, "x": np.array([0, 0.5, 1])}, {"time_unit": "us"}, "whole pixels"),
        ({**COLUMNS, "ts": np.array([1, 2])}, {"time_unit": "us"}, "rows of as many numbers"),
    ],
)
def test_what_fits_two_readings_or_none_is_named(tmp_path, variables, hints, said):
    savemat(tmp_path / "a.mat", variables)
    with pytest.raises(ValueError, match=said):
        read(tmp_path / "a.mat", **hints)


def test_damaged_files_are_named(tmp_path):
    (tmp_path / "a.mat").write_bytes(b"MATLAB 5.0 MAT-file".ljust(200, b"\x07"))
    (tmp_path / "b.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(900))
    for name in "ab":
        with pytest.raises(ValueError, match=r"Expected a whole (MATLAB|HDF5) file"):
            decode(tmp_path / f"{name}.mat")
