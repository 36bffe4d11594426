"""MATLAB files of every shape that people have hold the same events; doubts are asked about."""

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from eqs.events.formats import decode

T, X, Y, P = [10, 20, 20, 35], [0, 3, 7, 2], [5, 0, 1, 4], [1, 0, 1, 0]


def rows(found):
    return [list(map(int, getattr(found, name))) for name in "txyp"]


def column(values):
    return np.array(values, float)[:, None]


@pytest.mark.parametrize(
    "content",
    [
        {"t": column(T), "x": column(X), "y": column(Y), "p": column(P)},
        {"ts": T, "x": X, "y": Y, "pol": 2 * np.array(P) - 1},
        {"TD": {"x": column(X), "y": column(Y), "p": column(P) + 1, "ts": column(T)}, "meta": 7},
        {"events": np.array([T, X, Y, P]).T.astype(float)},
    ],
    ids=["variables", "signed", "structure of 1 and 2", "table"],
)
def test_every_shape_is_the_same_stream(tmp_path, content):
    savemat(tmp_path / "a.mat", content)
    found = decode(tmp_path / "a.mat", order="txyp", time_unit="us")
    assert rows(found) == [T, X, Y, P]
    assert found.kind.startswith("a MATLAB file")


@pytest.mark.parametrize("inside", ["", "events/"])
def test_the_newer_version_is_hdf5(tmp_path, inside):
    path = tmp_path / "a.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in {"t": T, "x": X, "y": Y, "p": P}.items():
            file[inside + name] = np.array([values], float)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(128))
    assert rows(decode(path, time_unit="us")) == [T, X, Y, P]


def test_counting_from_one_is_said(tmp_path):
    from_one = {"x": np.array(X) + 1, "y": np.array(Y) + 1, "p": P, "t": T}
    savemat(tmp_path / "a.mat", from_one)
    with pytest.raises(ValueError, match=r"first pixel is 0 or 1 in .*; set first_pixel"):
        decode(tmp_path / "a.mat", time_unit="us")
    assert rows(decode(tmp_path / "a.mat", time_unit="us", first_pixel=1)) == [T, X, Y, P]
    found = decode(tmp_path / "a.mat", time_unit="us", first_pixel=0)
    assert found.x.tolist() == [value + 1 for value in X]
    with pytest.raises(ValueError, match="unit of the whole-numbered times"):
        decode(tmp_path / "a.mat", first_pixel=1)


def test_other_content_and_damage_are_said(tmp_path):
    savemat(tmp_path / "a.mat", {"image": np.zeros((9, 9)), "name": "a"})
    with pytest.raises(ValueError, match=r"x, y, p and t .*got image, name; save them so"):
        decode(tmp_path / "a.mat")
    savemat(tmp_path / "b.mat", {"t": T, "x": X, "y": Y, "p": P[:2]})
    with pytest.raises(ValueError, match="of one length"):
        decode(tmp_path / "b.mat", time_unit="us")
    whole = (tmp_path / "b.mat").read_bytes()
    (tmp_path / "b.mat").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ValueError, match="whole MATLAB file at"):
        decode(tmp_path / "b.mat", time_unit="us")
