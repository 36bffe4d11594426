"""OpenEXR images, written by OpenEXR itself."""

import sys

import numpy as np
import pytest

from eqs.frames import FrameFolder, image_size, read_image

LEVELS = np.random.default_rng(0).random((4, 6, 3)).astype(np.float32)


@pytest.fixture
def openexr():
    return pytest.importorskip("OpenEXR")


def written(openexr, path, channels, **header):
    told = {"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage, **header}
    with openexr.File(told, channels) as file:
        file.write(str(path))
    return path


def layers(layer, levels=LEVELS):
    return {f"{layer}.{name}": levels[..., k].copy() for k, name in enumerate("RGB")}


@pytest.mark.parametrize("kind", ["RGB", "half", "RGBA", "Y", "layers"])
def test_levels_come_as_they_are_stored(tmp_path, openexr, kind):
    opaque = np.ones((4, 6, 1), np.float32)
    channels = {
        "RGB": {"RGB": LEVELS}, "half": {"RGB": LEVELS.astype(np.float16)},
        "RGBA": {"RGBA": np.concatenate([LEVELS, opaque], axis=2)},
        "Y": {"Y": LEVELS[..., 0].copy()},
        "layers": {**layers("View.Combined"), **layers("View.Normal", 1 - LEVELS),
                   "View.Depth.Z": LEVELS[..., 0].copy()},
    }[kind]  # fmt: skip
    path = written(openexr, tmp_path / "a.exr", channels)
    expected = LEVELS[..., 0] if kind == "Y" else LEVELS
    found = read_image(path, white=2)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, expected * 127.5, rtol=1e-3 if kind == "half" else 1e-6)
    assert image_size(path) == (4, 6)


def test_white_must_be_told(tmp_path, openexr):
    path = written(openexr, tmp_path / "a.exr", {"RGB": LEVELS})
    with pytest.raises(ValueError, match=r"which level is white in the floating image .*a\.exr"):
        read_image(path)


def test_pictures_with_a_background_parts_and_other_layers_are_refused(tmp_path, openexr):
    alpha = np.full((4, 6, 1), 0.5, np.float32)
    path = written(openexr, tmp_path / "a.exr", {"RGBA": np.concatenate([LEVELS, alpha], axis=2)})
    with pytest.raises(ValueError, match="got 24 transparent pixels"):
        read_image(path, 1)
    window = (np.array([0, 0], np.int32), np.array([9, 9], np.int32))
    path = written(openexr, tmp_path / "b.exr", {"RGB": LEVELS}, displayWindow=window)
    with pytest.raises(ValueError, match=r"a whole picture in .* without a border"):
        image_size(path)
    path = written(openexr, tmp_path / "c.exr", {"Z": LEVELS[..., 0].copy()})
    with pytest.raises(ValueError, match=r"grey or colour in .*, got Z; save one layer"):
        read_image(path, 1)
    both = {**layers("View.Diffuse"), **layers("View.Gloss")}
    path = written(openexr, tmp_path / "d.exr", both)
    with pytest.raises(ValueError, match=r"got View\.Diffuse, View\.Gloss; save one"):
        read_image(path, 1)


def test_a_damaged_image_ends_in_a_sentence(tmp_path, openexr, capfd):
    path = written(openexr, tmp_path / "a.exr", {"RGB": LEVELS})
    content = path.read_bytes()
    for length in (0, 50, len(content) - 30):
        path.write_bytes(content[:length])
        with pytest.raises(ValueError, match="Expected a readable OpenEXR image, got"):
            read_image(path, 1)


def test_a_folder_of_them_is_a_clip(tmp_path, openexr):
    for index in range(3):
        written(openexr, tmp_path / f"{index:04d}.exr", {"RGB": LEVELS * (index + 1) / 3})
    (_, _), (frames, times) = list(FrameFolder(tmp_path, [0, 10, 20], chunk=2, white=1))
    assert times.tolist() == [20]
    np.testing.assert_allclose(frames[0], LEVELS * 255, rtol=1e-5)


def test_without_the_library_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    (tmp_path / "a.exr").write_bytes(b"")
    with pytest.raises(ValueError, match=r"to read .*a\.exr, got none; type pip install"):
        read_image(tmp_path / "a.exr", 1)
