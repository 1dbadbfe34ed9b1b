"""Corners of grey images: Sobel edges for the corner table, and Trajkovic and Hedley's detector."""

import numpy as np
import pytest

from lidarium.mapping.merging.corners import CornerSettings, detect_corners
from lidarium.mapping.merging.grey_images import edge_levels, trajkovic_corners


def square(dark=60, light=200):
    """A light square of 30 pixels on dark ground; its corners are the pixels (20, 20) to (49, 49)."""
    image = np.full((70, 80), dark, np.uint8)
    image[20:50, 20:50] = light
    return image


def least_change(image, row, column):
    """The response of Trajkovic and Hedley by its definition: 400 lines between the four neighbours."""
    grey = image.astype(float)
    here = grey[row, column]
    east, west = grey[row, column + 1], grey[row, column - 1]
    north, south = grey[row + 1, column], grey[row - 1, column]
    values = []
    for share in np.linspace(0.0, 1.0, 400):
        for a, b in ((north, south), (south, north)):
            first, second = (1 - share) * east + share * a, (1 - share) * west + share * b
            values.append((first - here) ** 2 + (second - here) ** 2)
    return min(values)


def test_edges_are_where_greys_change_whatever_the_contrast():
    for light in (90, 200):
        levels = edge_levels(square(light=light))
        assert set(np.unique(levels)) == {0, 255}
        assert (levels[20:50, [19, 20]][1:-1] == 0).all()
        assert (levels[25:45, 25:45] == 255).all()
        assert (levels[:15] == 255).all()
    assert (edge_levels(np.full((9, 9), 130, np.uint8)) == 255).all()


def test_corners_of_a_grey_image_lie_within_its_edges():
    corners = detect_corners(edge_levels(square()), 0.05, CornerSettings(separation_m=0.0, limit=0))
    inner = {(21, 21), (48, 21), (21, 48), (48, 48)}
    assert inner <= {(int(x), int(y)) for x, y in corners.cells}


def test_trajkovics_corners_are_those_of_a_square():
    found = {(int(x), int(y)) for x, y in trajkovic_corners(square(), 1000.0, 1000.0)}
    corners = {(20, 20), (49, 20), (20, 49), (49, 49)}
    assert corners == found
    assert len(trajkovic_corners(square(), 1000.0, 1e6)) == 0


def test_trajkovics_response_is_the_least_change_along_all_lines():
    generator = np.random.default_rng(0)
    image = generator.integers(0, 256, (40, 40)).astype(np.uint8)
    threshold = 1500.0
    found = {(int(x), int(y)) for x, y in trajkovic_corners(image, 0.0, threshold)}
    assert len(found) > 5
    for column, row in found:
        assert least_change(image, row, column) > threshold - 20.0


def test_bad_images_and_thresholds_are_refused():
    with pytest.raises(ValueError, match="want rows and columns of uint8"):
        edge_levels(np.zeros((3, 3, 3), np.uint8))
    with pytest.raises(ValueError, match="share of edges is 0"):
        edge_levels(square(), 0.0)
    with pytest.raises(ValueError, match="zero or more"):
        trajkovic_corners(square(), -1.0, 0.0)
    assert len(trajkovic_corners(np.zeros((2, 5), np.uint8), 0.0, 0.0)) == 0
