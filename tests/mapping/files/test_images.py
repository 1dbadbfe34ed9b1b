"""Images are read with all their channels; their sizes are checked before."""

import cv2
import numpy as np
import pytest

from lidarium.mapping.files.images import read_image

GREYS = np.random.default_rng(0).integers(0, 256, (21, 34)).astype(np.uint8)


def encoded(suffix, pixels):
    return cv2.imencode(suffix, pixels)[1].tobytes()


@pytest.mark.parametrize("suffix", [".png", ".pgm", ".bmp", ".tif", ".jpg"])
def test_each_format_is_read_with_its_pixels(suffix, tmp_path):
    (tmp_path / "a").write_bytes(encoded(suffix, GREYS))
    pixels = read_image(tmp_path / "a")
    assert pixels.shape[:2] == (21, 34)
    if suffix != ".jpg":
        np.testing.assert_array_equal(pixels if pixels.ndim == 2 else pixels[..., 0], GREYS)


def test_sixteen_bits_and_opacity_are_kept(tmp_path):
    deep = GREYS.astype(np.uint16) * np.uint16(257)
    clear = np.dstack([GREYS, GREYS, GREYS, 255 - GREYS])
    for pixels in (deep, clear):
        (tmp_path / "a.png").write_bytes(encoded(".png", pixels))
        np.testing.assert_array_equal(read_image(tmp_path / "a.png"), pixels)


@pytest.mark.parametrize("content", [b"P2\n3 1\n100\n0 50 100", b"P5\n3 1\n100\n\x00\x32\x64"])
def test_white_is_the_greatest_number_whatever_the_file_calls_white(content, tmp_path):
    (tmp_path / "a.pgm").write_bytes(content)
    found = read_image(tmp_path / "a.pgm")
    assert found[0, 0] == 0
    assert found[0, 2] == 255
    assert abs(int(found[0, 1]) - 128) <= 1


@pytest.mark.parametrize("white", [1.0, 255.0])
def test_float_pixels_are_shares_or_greys(white, tmp_path):
    pixels = np.float32([[0.0, 0.4 * white, white]])
    (tmp_path / "a.tif").write_bytes(encoded(".tif", pixels))
    assert read_image(tmp_path / "a.tif").tolist() == [[0, 102 * 257, 65535]]
    (tmp_path / "a.tif").write_bytes(encoded(".tif", pixels - 1.0))
    with pytest.raises(ValueError, match="has float pixels from -1"):
        read_image(tmp_path / "a.tif")


@pytest.mark.parametrize("content", [b"", b"P5\n", b"no picture at all", b"\x89PNG\r\n\x1a\n", b"BM"])
def test_other_content_is_refused_by_name(content, tmp_path):
    (tmp_path / "a.png").write_bytes(content)
    with pytest.raises(ValueError, match=r"a\.png is not an image that can be read"):
        read_image(tmp_path / "a.png")


def test_coloured_pictures_may_have_fewer_pixels(tmp_path):
    for suffix in ("P5", "P6"):
        (tmp_path / suffix).write_bytes(f"{suffix}\n4900 4900\n255\n".encode() + bytes(3 * 4900 * 4900))
    assert read_image(tmp_path / "P5").shape == (4900, 4900)
    with pytest.raises(ValueError, match=r"it has 4,900 x 4,900 pixels .* want at most 12,000,000"):
        read_image(tmp_path / "P6")


@pytest.mark.parametrize("suffix", [".png", ".pgm", ".ppm", ".bmp", ".jpg", ".tif"])
@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_of_a_truncated_image_libraries_print_nothing(tmp_path, capfd, suffix, share):
    pixels = np.random.default_rng(0).integers(0, 255, (60, 60, 3), np.uint8)
    content = bytes(cv2.imencode(suffix, pixels if suffix != ".pgm" else pixels[..., 0])[1])
    path = tmp_path / f"cut{suffix}"
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(ValueError, match="not an image"):
        read_image(path)
    assert capfd.readouterr() == ("", "")
