"""Images are read at their full depth, upright and opaque."""

import cv2
import numpy as np
import pytest
from PIL import Image

from eqs.frames import FrameFolder, image_size, read_image

DEEP = (np.arange(6 * 4 * 3).reshape(6, 4, 3) * 900 + 7).astype(np.uint16)


@pytest.mark.parametrize("suffix", ["png", "tif"])
@pytest.mark.parametrize("colour", [False, True])
def test_sixteen_bits_keep_their_depth(tmp_path, suffix, colour):
    path, values = tmp_path / f"deep.{suffix}", DEEP if colour else DEEP[..., 0]
    cv2.imwrite(str(path), values[..., ::-1] if colour else values)
    found = read_image(path)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, values / 257.0, rtol=1e-6)
    assert image_size(path) == (6, 4)


def test_white_is_255_whatever_the_depth(tmp_path):
    Image.fromarray(np.full((2, 2), 65535, np.uint16)).save(tmp_path / "deep.png")
    Image.fromarray(np.full((2, 2), 255, np.uint8)).save(tmp_path / "plain.png")
    for name in ("deep.png", "plain.png"):
        assert (read_image(tmp_path / name) == 255).all()


def test_frames_of_two_depths_are_no_clip(tmp_path):
    Image.fromarray(np.zeros((2, 2), np.uint8)).save(tmp_path / "1.png")
    Image.fromarray(np.zeros((2, 2), np.uint16)).save(tmp_path / "2.png")
    with pytest.raises(ValueError, match=r"of float32 in .*2.png after \(2, 2\) of uint8"):
        list(FrameFolder(tmp_path, np.arange(2)))


@pytest.mark.parametrize("mode", ["RGBA", "LA", "P"])
@pytest.mark.parametrize("opaque", [True, False])
def test_alpha_is_left_out_or_refused(tmp_path, mode, opaque):
    path, levels = tmp_path / "a.png", np.uint8([[10, 20], [30, 40]])
    alpha = np.uint8([[255, 255], [255, 255 if opaque else 0]])
    if mode == "P":
        image = Image.fromarray(levels // 10 - 1, mode="L").convert("P")
        image.putpalette([10, 10, 10, 20, 20, 20, 30, 30, 30, 40, 40, 40])
        image.save(path, transparency=9 if opaque else 3)
    else:
        planes = [levels] * (3 if mode == "RGBA" else 1)
        Image.fromarray(np.stack([*planes, alpha], axis=-1), mode=mode).save(path)
    if opaque:
        found = read_image(path)
        assert found.dtype == np.uint8
        np.testing.assert_array_equal(found if found.ndim == 2 else found[..., 0], levels)
    else:
        with pytest.raises(
            ValueError, match=r"opaque picture, got 1 transparent pixels in .*a.png"
        ):
            read_image(path)


def test_transparent_colours_of_sixteen_bits_are_refused(tmp_path):
    deep = np.concatenate([DEEP, np.full((6, 4, 1), 65535, np.uint16)], axis=-1)
    cv2.imwrite(str(tmp_path / "a.png"), deep)
    assert read_image(tmp_path / "a.png").shape == (6, 4, 3)
    deep[0, 0, 3] = 0
    cv2.imwrite(str(tmp_path / "a.png"), deep)
    with pytest.raises(ValueError, match="got 1 transparent"):
        read_image(tmp_path / "a.png")


@pytest.mark.parametrize("suffix", ["png", "tif"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_an_image_is_read_upright(tmp_path, suffix, orientation):
    from PIL import ImageOps

    path = tmp_path / f"a.{suffix}"
    image = Image.fromarray(np.arange(24, dtype=np.uint8).reshape(6, 4))
    exif = image.getexif()
    exif[0x0112] = orientation
    image.save(path, exif=exif)
    shown = image.copy()
    shown.getexif()[0x0112] = orientation
    if suffix == "tif" and orientation > 4:
        with pytest.raises(ValueError, match=rf"stored upright, got orientation {orientation} in"):
            read_image(path)
        return
    expected = np.asarray(ImageOps.exif_transpose(shown))
    np.testing.assert_array_equal(read_image(path), expected)
    assert image_size(path) == expected.shape


def test_floating_images_take_a_word_about_white(tmp_path):
    path = tmp_path / "1.tif"
    Image.fromarray(np.float32([[0, 0.5], [0.25, 1]])).save(path)
    with pytest.raises(ValueError, match=r"which level is white .*go to 1\); set white=1 or"):
        read_image(path)
    assert read_image(path, white=1).tolist() == [[0, 127.5], [63.75, 255]]
    assert FrameFolder(tmp_path, np.arange(1), white=1).read(0, 1).max() == 255


def test_more_than_sixteen_bits_are_refused(tmp_path):
    Image.fromarray(np.int32([[1, 2], [3, 1 << 20]])).save(tmp_path / "a.tif")
    with pytest.raises(ValueError, match="8 or 16 bits, got 32 in"):
        read_image(tmp_path / "a.tif")


@pytest.mark.parametrize("shape", [(4, 6), (4, 6, 3)])
def test_arrays_of_a_renderer_are_images(tmp_path, shape):
    values = np.random.default_rng(0).random(shape)
    path = tmp_path / "0.npy"
    for array, white, expected in (
        ((values * 255).astype(np.uint8), None, (values * 255).astype(np.uint8)),
        ((values * 65535).astype(np.uint16), None, (values * 65535).astype(np.uint16) / 257),
        (values.astype(np.float32), 1.0, values * 255),
    ):
        np.save(path, array)
        assert image_size(path) == (4, 6)
        assert read_image(path, white) == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize(
    ("array", "said"),
    [
        (np.zeros((4, 6), np.float32), "which level is white"),
        (np.zeros((4, 6), np.int64), "8 or 16 bits or floating numbers in .*int64"),
        (np.zeros((4, 6, 2), np.uint8), r"\(H, W\) or \(H, W, 3\) .*got \(4, 6, 2\)"),
    ],
)
def test_arrays_that_are_no_images_are_refused(tmp_path, array, said):
    np.save(tmp_path / "0.npy", array)
    with pytest.raises(ValueError, match=said):
        read_image(tmp_path / "0.npy")
    (tmp_path / "1.npy").write_bytes(b"\x93NUMPY")
    with pytest.raises(ValueError, match="readable array"):
        image_size(tmp_path / "1.npy")
