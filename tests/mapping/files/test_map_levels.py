"""Levels of a map from the pixels of its picture."""

import numpy as np
import pytest

from lidarium.mapping.files import map_levels
from lidarium.mapping.files.map_levels import FREE, OCCUPIED, UNKNOWN, levels_by_blocks, levels_of, raw_levels


def trinary(shades):
    return levels_of(shades, negate=False, low=0.2, high=0.65)


def test_thresholds_are_of_occupancy_and_are_themselves_unknown():
    shades = np.array([[0.0, 255.0 * 0.34, 255.0 * 0.35, 255.0 * 0.8, 255.0 * 0.81, 255.0]])
    assert trinary(shades).tolist() == [[OCCUPIED, OCCUPIED, UNKNOWN, UNKNOWN, FREE, FREE]]
    negated = levels_of(255.0 - shades, negate=True, low=0.2, high=0.65)
    np.testing.assert_array_equal(negated, trinary(shades))


def test_a_grey_that_stands_for_unknown_is_that_whatever_the_thresholds():
    shades = np.array([[204.0, 205.0, 205.6]])
    assert levels_of(shades, negate=False, low=0.3, high=0.65, unknown=205).tolist() == [
        [FREE, UNKNOWN, FREE]
    ]


def test_raw_pixels_are_percent_of_occupancy():
    shades = np.array([[0.0, 19.0, 20.0, 65.0, 66.0, 100.0, 101.0, 255.0]])
    expected = [FREE, FREE, UNKNOWN, UNKNOWN, OCCUPIED, OCCUPIED, UNKNOWN, UNKNOWN]
    assert raw_levels(shades, 0.2, 0.65).tolist() == [expected]


@pytest.mark.parametrize("channels", [1, 3])
def test_greys_colours_and_sixteen_bits_give_the_same_levels(channels):
    grey = np.array([[0, 128, 255]], np.uint8)
    pixels = grey if channels == 1 else np.repeat(grey[..., None], 3, axis=2)
    expected = trinary(grey.astype(float))
    np.testing.assert_array_equal(levels_by_blocks(pixels, trinary, False), expected)
    deep = pixels.astype(np.uint16) * np.uint16(257)
    np.testing.assert_array_equal(levels_by_blocks(deep, trinary, False), expected)


def test_what_is_not_opaque_is_unknown_where_that_is_asked_for():
    pixels = np.zeros((1, 3, 4), np.uint8)
    pixels[..., 3] = [[255, 254, 0]]
    assert levels_by_blocks(pixels, trinary, True).tolist() == [[OCCUPIED, UNKNOWN, UNKNOWN]]
    assert levels_by_blocks(pixels, trinary, False).tolist() == [[OCCUPIED] * 3]


def test_blocks_make_no_difference(monkeypatch):
    pixels = np.random.default_rng(0).integers(0, 256, (50, 40, 2)).astype(np.uint8)
    whole = levels_by_blocks(pixels, trinary, True)
    monkeypatch.setattr(map_levels, "_BLOCK_PIXELS", 130)
    np.testing.assert_array_equal(levels_by_blocks(pixels, trinary, True), whole)
