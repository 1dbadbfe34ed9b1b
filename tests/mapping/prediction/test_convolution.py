"""Convolutions of images with a border of zeros."""

import numpy as np
import pytest

from lidarium.mapping.prediction.convolution import Image, Layer


def plain(pixels, weight, step=1, dilation=1):
    """Return the convolution of (channels, rows, columns) with (outputs, channels, side, side), pixel by pixel."""
    side = weight.shape[-1]
    reach = dilation * (side // 2)
    padded = np.pad(pixels, ((0, 0), (reach, reach), (reach, reach)))
    found = np.zeros((len(weight), -(-pixels.shape[1] // step), -(-pixels.shape[2] // step)), np.float32)
    for row, column in np.ndindex(found.shape[1:]):
        seen = padded[
            :,
            step * row : step * row + dilation * side : dilation,
            step * column : step * column + dilation * side : dilation,
        ]
        found[:, row, column] = np.tensordot(weight, seen, 3)
    return found


def whole(shape, seed):
    """Return small integers, whose sums are exact in any order."""
    return np.random.default_rng(seed).integers(-9, 10, shape).astype(np.float32)


@pytest.mark.parametrize("shape", [(3, 12, 10), (8, 6, 6), (16, 20, 34)])
@pytest.mark.parametrize("outputs", [4, 8, 24])
@pytest.mark.parametrize(("side", "dilation"), [(1, 1), (3, 1), (3, 2)])
def test_sums_are_those_of_each_pixel(shape, outputs, side, dilation):
    pixels, weight, bias = whole(shape, 1), whole((outputs, shape[0], side, side), 2), whole(outputs, 3)
    found = Layer.of(weight, bias)(Image.of(pixels, border=dilation))
    np.testing.assert_array_equal(found.inner, plain(pixels, weight, dilation=dilation) + bias[:, None, None])
    border = found.whole.copy()
    border[:, dilation:-dilation, dilation:-dilation] = 0.0
    assert not border.any()


@pytest.mark.parametrize("shape", [(3, 12, 10), (8, 8, 40)])
def test_of_every_second_pixel(shape):
    pixels, weight = whole(shape, 1), whole((8, shape[0], 3, 3), 2)
    found = Layer.of(weight, None)(Image.of(pixels).halved())
    np.testing.assert_array_equal(found.inner, plain(pixels, weight, step=2))


def test_sums_are_rectified_before_the_input_is_added():
    pixels, weight = whole((8, 10, 10), 1), whole((8, 8, 3, 3), 2)
    found = Layer.of(weight, None)(Image.of(pixels), rectifies=True, adds_input=True)
    np.testing.assert_array_equal(found.inner, np.maximum(plain(pixels, weight), 0.0) + pixels)


def test_sums_are_added_to_an_image_of_half_the_size():
    pixels, weight, coarse = whole((5, 12, 8), 1), whole((8, 5, 1, 1), 2), whole((8, 6, 4), 3)
    doubled = Image.of(coarse).doubled()
    np.testing.assert_array_equal(doubled.inner, coarse.repeat(2, axis=1).repeat(2, axis=2))
    found = Layer.of(weight, None)(Image.of(pixels), onto=doubled, rectifies=True)
    wanted = plain(pixels, weight) + coarse.repeat(2, axis=1).repeat(2, axis=2)
    np.testing.assert_array_equal(found.inner, np.maximum(wanted, 0.0))


def test_another_border_leaves_the_pixels():
    pixels = whole((2, 4, 6), 1)
    np.testing.assert_array_equal(Image.of(pixels).with_border(3).inner, pixels)
