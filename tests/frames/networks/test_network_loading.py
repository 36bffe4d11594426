"""What is no network is said to be none, with what it is."""

import numpy as np
import pytest
import torch

from eqs.frames.networks import network_of

WANTED = "Expected a TorchScript file, a Super SloMo checkpoint or RIFE 4.25 weights, got "


@pytest.mark.parametrize(
    ("content", "got"),
    [
        ([1, 2], "a list"),
        (torch.zeros(3), "a Tensor"),
        ({"epoch": 3, "net.weight": torch.zeros(2)}, "a dictionary with epoch, net.weight"),
        ({f"w{k}": torch.zeros(2) for k in range(9)}, "a dictionary with w0, w1, w2, w3, ..."),
        ({1: 2}, "a dictionary with 1"),
        ({}, "a dictionary with nothing"),
    ],
)
def test_what_a_file_holds_is_said(saved, content, got):
    path = saved(content)
    with pytest.raises(ValueError) as stop:  # noqa: PT011 - compared below
        network_of(path)
    assert str(stop.value) == f"{WANTED}{got} at {path}; set interpolation.inner.network"


@pytest.mark.parametrize(
    "content", [b"", b"nothing", b"\x80\x02nothing", b"PK\x03\x04" + bytes(99)]
)
def test_files_that_are_no_networks(tmp_path, content):
    (tmp_path / "file.pt").write_bytes(content)
    with pytest.raises(ValueError, match=f"{WANTED}a file that PyTorch cannot read at"):
        network_of(tmp_path / "file.pt")


def test_an_archive_of_other_things(tmp_path):
    np.savez(tmp_path / "file.npz", a=np.zeros(3))
    with pytest.raises(ValueError, match=f"{WANTED}a file that PyTorch cannot read at"):
        network_of(tmp_path / "file.npz")


def test_a_file_cut_short(saved):
    path = saved({"block0.conv0.0.0.weight": torch.rand(100)})
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(ValueError, match=f"{WANTED}a file that PyTorch cannot read at"):
        network_of(path)
